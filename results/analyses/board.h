// What a reader asks first: which policy with which controller, how sure, and whether the engine matters. Combinations
// by their mean success over engines, and the lead of the first one. Nothing depends on the order of rows.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "duet/results/analyses/contact_table.h"
#include "duet/results/analyses/cross_engine.h"
#include "duet/results/analyses/leaderboard.h"

namespace duet {

// Of the episodes with a solid partner, in physics engines.
struct BoardContact {
  long episodes = 0, touched = 0, over = 0;  // over: a limit of force or pressure
  double worst_ratio = 0.0;                  // of a force or pressure over its limit; NaN: no limit is stated
};

struct BoardRow {
  std::string controller, policy, perturbation;
  long n = 0;                     // episodes of each engine that count: those that all engines ran
  double mean = 0.0;              // success, over engines; each counts the same
  Interval interval;              // bootstrap over clips; in one engine alone Wilson
  std::vector<EngineRate> rates;  // physics engines by name; playback alone where there is nothing else
  std::optional<EngineRate> playback;
  double null_rate = 0.0;           // of the null arm, over the same engines; NaN where it was not run
  long fell = 0, unfinished = 0;    // unfinished: diverged, timed out, ended in an error, unsupported; of all engines
  double sd = 0.0, noise_sd = 0.0;  // of the rates, and what independent episodes would give; NaN in one engine
  std::optional<BoardContact> contact;

  // "wbc_sim with dstar", and the perturbation unless it is clean.
  [[nodiscard]] std::string name() const;
};

// Success of the first minus that of the second, clip by clip and engine by engine.
struct BoardLead {
  double difference = 0.0;
  Interval interval;  // bootstrap over clips
  long clips = 0;     // that both ran
};

struct Board {
  std::vector<BoardRow> rows;  // best first; equal ones by name. Clean episodes, where there are any
  std::optional<BoardLead> lead;
  long engines = 0;             // physics engines
  double winner_changes = 0.0;  // probability that another engine has another winner; NaN where it is not known
  double level = 0.95;
};

Board board(const std::vector<EpisodeRow>& rows, const std::vector<LeaderboardEntry>& entries,
            const CrossEngine& engines, const ContactTable& contacts);

// Sentences: which is best, whether its lead over the next is more than chance, whether the engine matters, what a
// robot that stands still reaches. None for a board without rows.
std::vector<std::string> board_verdict(const Board& board);

// The verdict and a ranked table, for a terminal.
std::string board_markdown(const Board& board);

}  // namespace duet
