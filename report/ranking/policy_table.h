// Figures of a policy beside others, without perturbation: success under the headline detector and as the paper's
// detectors see it, the lift over the null arm, falls, contact limits and jerk, per engine and over physics engines
// ("playback" stands apart and is in no mean); by task, with the supplement's Table S9 beside it; every policy against
// every other episode by episode. Nothing depends on the order of rows.
#pragma once

#include <array>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/task.h"
#include "duet/report/ranking/leaderboard.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/tables/analysis.h"

namespace duet {

// Figures of one (engine, controller, arm, policy), perturbation clean.
struct PolicyFigures {
  PolicyKey key;
  Rate success, paper;                                 // headline; detector paper/paper, n = 0 where no row has it
  PairedDifference lift;                               // over the null arm, as in the leaderboard
  Rate falls;                                          // episodes with a fall
  Rate violations;                                     // over a contact limit, of the episodes with a solid partner
  double contact_peak = 0.0, contact_settled = 0.0;    // medians of the episodes that touch a solid partner [N]
  double stamping = 0.0;                               // median of the ground's largest force over its mean [1]
  double dof_jerk = 0.0;                               // mean over episodes [rad/s^3]; NaN: no row has it
  std::map<std::string, Rate> by_task, by_task_paper;  // "all" included
};

// How tables call a figure and which way is worse.
struct PolicyFigure {
  std::string_view name, title;
  bool share;  // printed in %
  std::string_view unit;
  bool higher_is_better;
  double (*value)(const PolicyFigures& figures);  // NaN: none
};
inline constexpr std::array<PolicyFigure, 9> kPolicyFigures = {{
    {"success", "Success [%]", true, "1", true, [](const PolicyFigures& f) { return f.success.rate; }},
    {"paper_success", "Success, paper's detectors [%]", true, "1", true,
     [](const PolicyFigures& f) { return f.paper.rate; }},
    {"lift", "Lift [points]", true, "1", true, [](const PolicyFigures& f) { return f.lift.difference; }},
    {"falls", "Falls [%]", true, "1", false, [](const PolicyFigures& f) { return f.falls.rate; }},
    {"violations", "Over a contact limit [%]", true, "1", false,
     [](const PolicyFigures& f) { return f.violations.rate; }},
    {"contact_peak", "Contact, peak [N]", false, "N", false, [](const PolicyFigures& f) { return f.contact_peak; }},
    {"contact_settled", "Contact after 0.1 s [N]", false, "N", false,
     [](const PolicyFigures& f) { return f.contact_settled; }},
    {"stamping", "Ground force [weight]", false, "1", false, [](const PolicyFigures& f) { return f.stamping; }},
    {"dof_jerk", "DOF jerk [rad/s^3]", false, "rad/s^3", false, [](const PolicyFigures& f) { return f.dof_jerk; }},
}};

// One (controller, arm, policy) in all its engines.
struct PolicyLine {
  std::string controller, arm, policy;
  std::vector<PolicyFigures> engines;  // physics engines by name, then playback
  // Success over the episodes that all its physics engines ran, each engine counting the same.
  double mean_success = 0.0;
  Interval mean_interval;  // by clip (wilson_by_clip): says nothing of other engines
};

// A figure over the physics engines of a line.
struct OverEngines {
  long engines = 0;  // that have it
  double mean = 0.0, range = 0.0;
  std::string worst;  // the engine
};
OverEngines over_engines(const PolicyLine& line, const PolicyFigure& figure);

struct PolicyTable {
  double level = 0.95;
  std::vector<PolicyLine> lines;              // by controller, arm, policy
  std::vector<Comparison> pairs;              // "mujoco/wbc_sim: dstar vs replay", p_holm over all of them
  std::map<std::string, long> could_not_run;  // policy -> its episodes, all of them unsupported
  std::vector<std::string> faults;            // a sentence for each policy that lost plans or died
};

// Empty where the only policy is `replay`, which decides nothing. Throws InputError as leaderboard() does.
PolicyTable policy_table(const std::vector<EpisodeRow>& rows, const IntervalOptions& options = {});

struct PaperTaskRate {
  Task task;
  double percent;
};
// A row of Table S9 as the supplement prints it, in %: overall, then by task.
struct PaperPolicy {
  std::string_view name, family;  // family and size of the perturbation, "" for none
  double size;                    // [m] or a probability
  double overall;
  std::array<PaperTaskRate, kPaperTasks.size()> tasks;
};
std::span<const PaperPolicy> paper_policies();
std::string paper_detector_sentence();  // why only one column can be held against it

// A column per figure for one engine, a table per figure for several; by task with the paper's rows; policies in pairs.
Analysis policy_analysis(const PolicyTable& table);

}  // namespace duet
