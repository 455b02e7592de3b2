// The board answers a reader's first questions: which policy with which controller, how sure, and whether the engine
// matters. It lists competitors by mean success over engines, the lead of the first and its lift over the best control;
// beside them, without a rank, the arms that are references (core/task.h). Nothing depends on the order of rows.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "duet/core/task.h"
#include "duet/report/engines/cross_engine.h"
#include "duet/report/ranking/contact_table.h"
#include "duet/report/tables/analysis.h"

namespace duet {

// Facts about the suite that its rows do not have.
struct RankingSuite {
  std::string label = {};    // "hhoi-sealed 1.0.0, as it ships (45a100d81a17)"; "" where nobody knows
  std::string warning = {};  // a sentence where it is not the suite of that name that ships; else ""
  PolicyRoles roles = {};
};

// Contact in the episodes with a solid partner, in physics engines.
struct RankingContact {
  long episodes = 0, touched = 0, over = 0;  // over: a limit of force or pressure
  double worst_ratio = 0.0;                  // of a force or pressure over its limit; NaN: no limit is stated
};

struct RankingRow {
  std::string controller = {}, policy = {}, perturbation = {}, arm = {};
  PolicyRole role = {};
  std::size_t rank = 0;                // from 1; equal means have one. 0: a reference
  long n = 0;                          // episodes of each engine that count: those that all engines ran
  double mean = 0.0;                   // success, over engines; each counts the same
  Interval interval = {};              // by clip; in one engine alone Wilson's, unless a clip has several draws
  std::vector<EngineRate> rates = {};  // physics engines by name; playback alone where there is nothing else
  double null_rate = 0.0;              // of the null arm, over the same episodes; NaN where it was not run
  long fell = 0, unfinished = 0;  // unfinished: diverged, timed out, ended in an error, unsupported; of all engines
  std::optional<RankingContact> contact = {};

  // "wbc_sim with dstar", the perturbation unless it is clean, and what a reference is: "(knows the motion)".
  [[nodiscard]] std::string name() const;
};

// Success of one row less that of another, over the episodes of both.
struct RankingDifference {
  std::string other;  // its name
  double difference = 0.0;
  Interval interval;  // newcombe_by_clip
  long clips = 0;     // that both ran
  double p = 1.0;     // sign_flip_exact
};

// The claim that it allows: fewer clips than kFewestClips say nothing, however they fall. A lead takes both the exact
// test and the interval; where one alone sees it, a sentence says which does not.
enum class Told { kAhead, kApart, kTestAlone, kIntervalAlone, kTooFewClips };  // kApart: not told apart, or behind
Told told(const RankingDifference& difference, double level);

// How far the rates of the first row lie apart.
struct RankingSpread {
  EngineRate lowest, highest;
  double p = 1.0;  // sign_flip_exact between the two, corrected for the pairs of engines
};

struct Ranking {
  RankingSuite suite = {};
  std::vector<RankingRow> rows =
      {};                   // competitors, best first; equal ones by name. Clean episodes, where there are any
  bool of_oracles = false;  // no policy competes: `rows` are those that know the motion, under several controllers
  std::vector<RankingRow> references = {};     // oracles, then controls, each best first
  std::optional<RankingDifference> lead = {};  // of the first over the next
  std::optional<RankingDifference> lift = {};  // of the first over the best control of its controller
  std::optional<RankingSpread> spread = {};    // of several engines
  std::vector<std::string> won_by_another =
      {};  // engines in which another competitor has more successes than the first
  double level = 0.95;
};

// `contacts`: of contact_analysis. Throws InputError: rows of two suites or suite versions, an episode that is there
// twice.
Ranking rank_policies(const std::vector<EpisodeRow>& rows, const Estimates& contacts, const RankingSuite& suite = {},
                      double level = 0.95);

// Sentences: which is best and whether it is told apart from the next, its lift, what the references reach, whether the
// engine matters, and a suite that is not the one that ships. None for a board without rows and references.
std::vector<std::string> ranking_verdict(const Ranking& board);

// The verdict, the ranked table and their figures.
inline constexpr const char* kRankingName = "board";  // of its analysis
Analysis ranking_analysis(const Ranking& board);

// The same for a terminal of 100 columns, on one screen of at most kScreenLines; `notes` come first.
inline constexpr std::size_t kScreenColumns = 100, kScreenLines = 20;
std::string ranking_screen(const Ranking& board, const std::vector<std::string>& notes);

}  // namespace duet
