#include "duet/report/ranking/policy_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>

#include "duet/core/numbers.h"
#include "duet/report/ranking/comparison.h"
#include "duet/report/ranking/contact_table.h"
#include "duet/report/ranking/leaderboard_rows.h"
#include "duet/report/ranking/policy_groups.h"

namespace duet {
namespace {

constexpr std::string_view kPaperDetector = "paper/paper";
constexpr std::string_view kReplay = "replay";
constexpr const char* kOverall = "all";
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

constexpr std::array<PaperTaskRate, 6> rates(double hug, double handshake, double high_five, double wave, double bend,
                                             double fly_kiss) {
  return {{{Task::kHug, hug},
           {Task::kHandshake, handshake},
           {Task::kHighFive, high_five},
           {Task::kWave, wave},
           {Task::kBend, bend},
           {Task::kFlyKiss, fly_kiss}}};
}

// Source: supplement C.3.3, Table S9.
constexpr std::array<PaperPolicy, 9> kPaperPolicies = {
    {{"D-STAR", "", 0.0, 84.9, rates(93.3, 77.4, 70.4, 96.3, 93.3, 90.9)},
     {"D-STAR, jitter 1 cm", "jitter", 0.01, 80.2, rates(93.3, 64.5, 63.0, 96.3, 93.3, 90.9)},
     {"D-STAR, jitter 2 cm", "jitter", 0.02, 79.4, rates(100.0, 61.3, 59.3, 96.3, 93.3, 90.9)},
     {"D-STAR, jitter 5 cm", "jitter", 0.05, 77.8, rates(100.0, 58.1, 55.6, 96.3, 93.3, 90.9)},
     {"D-STAR, dropout 0.05", "dropout", 0.05, 78.6, rates(100.0, 61.3, 59.3, 92.6, 93.3, 90.9)},
     {"D-STAR, dropout 0.1", "dropout", 0.1, 78.6, rates(93.3, 67.7, 51.9, 96.3, 93.3, 90.9)},
     {"D-STAR, dropout 0.2", "dropout", 0.2, 75.4, rates(93.3, 58.1, 48.1, 96.3, 93.3, 90.9)},
     {"D-STAR, HOMIE, waist free", "", 0.0, 67.8, rates(66.8, 46.7, 33.8, 93.8, 96.0, 86.4)},
     {"D-STAR, HOMIE, waist locked", "", 0.0, 66.1, rates(56.2, 47.5, 32.9, 93.8, 97.5, 86.4)}}};

// How tables call an estimate of all tasks, and which way is worse.
struct PolicyFigure {
  const char *name, *title;
  bool share;  // printed in %
  const char* unit;
  bool higher_is_better;
};
constexpr PolicyFigure kPolicyFigures[] = {{"success", "Success [%]", true, "1", true},
                                           {"paper_success", "Success, paper's detectors [%]", true, "1", true},
                                           {"lift", "Lift [points]", true, "1", true},
                                           {"falls", "Falls [%]", true, "1", false},
                                           {"violations", "Over a contact limit [%]", true, "1", false},
                                           {"contact_peak", "Contact, peak [N]", false, "N", false},
                                           {"contact_settled", "Contact after 0.1 s [N]", false, "N", false},
                                           {"stamping", "Ground force [weight]", false, "1", false},
                                           {"dof_jerk", "DOF jerk [rad/s^3]", false, "rad/s^3", false}};

// The success rate of an entry under the paper's detector, over its n episodes; none where no row has the verdict.
Rate paper_rate(const LeaderboardEntry& entry) {
  const auto found = entry.other_success.find(std::string(kPaperDetector));
  if (found == entry.other_success.end()) return {};
  return make_rate(std::lround(found->second * static_cast<double>(entry.n)), entry.n, entry.level);
}

Rate rate_of(const LeaderboardEntry& entry) {
  return {.n = entry.n, .k = entry.k, .rate = entry.success, .interval = entry.interval};
}

Rate violation_rate(const EpisodeRows& rows, double level) {
  long solid = 0;
  long over = 0;
  for (const auto& [id, row] : rows) {
    if (!has_solid_partner(*row)) continue;
    ++solid;
    over += is_over_limit(*row) ? 1 : 0;
  }
  return make_rate(over, solid, level);
}

// Median over the episodes that have it; NaN where none has.
template <typename Value>
double median_of(const EpisodeRows& rows, Value value) {
  std::vector<double> values;
  for (const auto& [id, row] : rows)
    if (const double of = value(*row); std::isfinite(of)) values.push_back(of);
  return quantile(std::move(values), 0.5);
}

double force_of(const EpisodeRow& row, const char* name) {
  const auto found = row.forces.find(name);
  return found == row.forces.end() ? kNone : found->second;
}

// The mean force of the ground on a robot that stands is its weight.
double stamping_of(const EpisodeRow& row) {
  const double mean = force_of(row, "ground.mean_n");
  return mean > 0.0 ? force_of(row, "ground.peak_n") / mean : kNone;
}

// Medians of contact are of the episodes that touch a solid partner.
void add_forces(const EpisodeRows& rows, long n, const EstimatesOf& of) {
  const auto touching = [](const char* name) {
    return [name](const EpisodeRow& row) { return force_of(row, "human.peak_n") > 0.0 ? force_of(row, name) : kNone; };
  };
  of.add("contact_peak", n, median_of(rows, touching("human.peak_n")), kNoInterval, "N");
  of.add("contact_settled", n, median_of(rows, touching("human.settled_n")), kNoInterval, "N");
  of.add("stamping", n, median_of(rows, stamping_of));
}

using EntriesByTask = std::map<std::string, const LeaderboardEntry*>;

// One policy in one engine, clean: by task success under the headline detector and as the paper's detectors see it;
// over all tasks the lift over the null arm, falls, contact limits (of the episodes with a solid partner), forces and
// jerk.
Estimates policy_estimates(const PolicyKey& key, const EntriesByTask& entries, const EpisodeRows& rows, double level) {
  Estimates estimates;
  EstimatesOf of = estimates_of(key, estimates);
  of.keys.perturbation = kClean;
  for (const auto& [task, entry] : entries) {
    of.keys.task = task;
    of.rate("success", rate_of(*entry));
  }
  for (const auto& [task, entry] : entries) {
    of.keys.task = task;
    if (const Rate paper = paper_rate(*entry); paper.n > 0) of.rate("paper_success", paper);
  }
  const LeaderboardEntry& overall = *entries.at(kOverall);
  of.keys.task = kOverall;
  of.add("lift", overall.pairs, overall.lift, overall.lift_interval);
  of.rate("falls", make_rate(overall.fell, overall.n, overall.level));
  of.rate("violations", violation_rate(rows, level));
  add_forces(rows, overall.n, of);
  const auto jerk = overall.metrics.find("dof_jerk");
  of.add("dof_jerk", overall.n, jerk == overall.metrics.end() ? kNone : jerk->second, kNoInterval, "rad/s^3");
  return estimates;
}

// One (controller, arm, policy) in all its engines.
struct PolicyLine {
  Estimate keys;                                                // its engine is "all"
  std::vector<std::pair<PolicyKey, const Estimates*>> engines;  // physics engines by name, then playback
};

bool is_physics(const PolicyKey& key) { return key.engine != kPlaybackEngine; }

// The mean over physics engines of the episodes that all of them ran, each engine counting the same; its interval is by
// clip and says nothing of other engines.
void add_mean(const std::map<PolicyKey, PerturbedRows>& policies, const PolicyLine& line, double level,
              const EstimatesOf& of) {
  std::vector<const EpisodeRows*> engines;
  for (const auto& [key, estimates] : line.engines)
    if (is_physics(key)) engines.push_back(&policies.at(key).find(kClean)->second);
  SuccessByClip means;
  for (const auto& [id, row] : engines.empty() ? EpisodeRows() : *engines.front()) {
    double successes = 0.0;
    bool in_all = true;
    for (const EpisodeRows* episodes : engines) {
      const auto found = episodes->find(id);
      in_all = in_all && found != episodes->end();
      if (in_all) successes += headline_success(*found->second) ? 1.0 : 0.0;
    }
    if (in_all) means.add(id, successes / static_cast<double>(engines.size()));
  }
  of.add("mean_success", {}, means.mean(), means.clips() == 0 ? kNoInterval : means.by_clip(level));
}

// Adds mean, range and worst engine over the physics engines that have the figure; nothing where none has.
void add_over_engines(const PolicyLine& line, const PolicyFigure& figure, EstimatesOf of) {
  long count = 0;
  double sum = 0.0, low = kNone, high = kNone, worst_value = kNone;
  std::string worst;
  for (const auto& [key, estimates] : line.engines) {
    const Estimate* found = find_estimate(*estimates, {.task = kOverall, .name = figure.name});
    if (!is_physics(key) || found == nullptr || !std::isfinite(found->value)) continue;
    const double value = found->value;
    if (count++ == 0 || (figure.higher_is_better ? !(value >= low) : !(value <= high))) {
      worst = key.engine;
      worst_value = value;
    }
    low = std::fmin(low, value);
    high = std::fmax(high, value);
    sum += value;
  }
  if (count == 0) return;
  of.add(fmt::format("{}_mean", figure.name), count, sum / static_cast<double>(count), kNoInterval, figure.unit);
  of.add(fmt::format("{}_range", figure.name), count, high - low, kNoInterval, figure.unit);
  of.keys.engine = worst;
  of.add(fmt::format("{}_worst", figure.name), count, worst_value, kNoInterval, figure.unit);
}

// By controller, arm and policy.
std::vector<PolicyLine> lines_of(const std::map<PolicyKey, Estimates>& estimates) {
  std::map<std::tuple<std::string, std::string, std::string>, PolicyLine> lines;
  for (const auto& [key, of] : estimates) {
    PolicyLine& line = lines[{key.controller, key.arm, key.policy}];
    line.keys = keys_of(key);
    line.engines.emplace_back(key, &of);
  }
  std::vector<PolicyLine> list;
  for (auto& [key, line] : lines) {
    std::stable_partition(line.engines.begin(), line.engines.end(),
                          [](const auto& engine) { return is_physics(engine.first); });
    line.keys.engine = line.keys.task = kOverall;
    line.keys.perturbation = kClean;
    list.push_back(std::move(line));
  }
  return list;
}

// The episodes of two policies of one engine and controller; nothing where they share none.
void add_pair(const PolicyKey& a, const EpisodeRows& of_a, const PolicyKey& b, const EpisodeRows& of_b,
              const IntervalOptions& options, Estimates& into) {
  PairedRows gathered;
  for (const auto& [id, row] : of_a) {
    const auto found = of_b.find(id);
    found == of_b.end() ? void(++gathered.unpaired_a) : gathered.pairs.add(*row, *found->second);
  }
  if (gathered.pairs.table().pairs() == 0) return;
  gathered.unpaired_b = static_cast<long>(of_b.size()) - gathered.pairs.table().pairs();
  add_comparison(gathered, options,
                 {{.engine = a.engine,
                   .controller = a.controller,
                   .policy = fmt::format("{} vs {}", a.policy, b.policy),
                   .perturbation = std::string(kClean),
                   .task = kOverall},
                  into});
}

// Every policy with every other of the same engine and controller.
Estimates all_pairs(const std::map<PolicyKey, PerturbedRows>& policies, const IntervalOptions& options) {
  Estimates pairs;
  for (auto a = policies.begin(); a != policies.end(); ++a) {
    for (auto b = std::next(a); b != policies.end(); ++b) {
      if (std::tie(a->first.engine, a->first.controller) != std::tie(b->first.engine, b->first.controller)) break;
      const auto of_a = a->second.find(kClean), of_b = b->second.find(kClean);
      if (of_a != a->second.end() && of_b != b->second.end())
        add_pair(a->first, of_a->second, b->first, of_b->second, options, pairs);
    }
  }
  judge_family("difference_by_clip", options.level, kFivePoints, pairs);
  return pairs;
}

std::map<std::string, long> policies_that_never_ran(const std::vector<LeaderboardEntry>& entries) {
  std::map<std::string, std::pair<long, long>> episodes;  // all, unsupported
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task != "all" || entry.arm == "null") continue;
    episodes[entry.policy].first += entry.n;
    episodes[entry.policy].second += entry.unsupported;
  }
  std::map<std::string, long> never;
  for (const auto& [policy, counts] : episodes)
    if (counts.first == counts.second) never[policy] = counts.first;
  return never;
}

// Keeps pointers into `entries`.
std::map<PolicyKey, Estimates> clean_estimates(const std::vector<LeaderboardEntry>& entries,
                                               const std::map<PolicyKey, PerturbedRows>& policies, double level) {
  std::map<PolicyKey, EntriesByTask> clean;
  for (const LeaderboardEntry& entry : entries) {
    const PolicyKey key{entry.engine, entry.controller, entry.arm, entry.policy};
    const auto rows = policies.find(key);
    if (entry.perturbation != kClean || rows == policies.end() || !rows->second.contains(kClean)) continue;
    clean[key][entry.task] = &entry;
  }
  std::map<PolicyKey, Estimates> estimates;
  for (const auto& [key, by_task] : clean)
    estimates[key] = policy_estimates(key, by_task, policies.at(key).find(kClean)->second, level);
  return estimates;
}

void add_paper_policies(Estimates& into) {
  for (const PaperPolicy& paper : paper_policies()) {
    if (!paper.family.empty()) continue;
    EstimatesOf of{{.source = "paper", .policy = std::string(paper.name), .task = kOverall}, into};
    of.add("paper_success", {}, paper.overall / 100.0);
    for (const PaperTaskRate& rate : paper.tasks) {
      of.keys.task = to_string(rate.task);
      of.add("paper_success", {}, rate.percent / 100.0);
    }
  }
}

CellText figure_text(const PolicyFigure& figure) {
  const std::string_view name = figure.name;
  if (name == "success" || name == "paper_success") return as_percent;
  if (name == "lift") return as_points;
  if (figure.share) return as_share;
  return [](const Estimate& of) {
    return std::isfinite(of.value) ? fmt::format("{:.{}f}", of.value, std::abs(of.value) >= 100.0 ? 0 : 2) : "-";
  };
}

std::vector<PolicyFigure> figures_in(const Estimates& estimates) {
  std::vector<PolicyFigure> figures;
  std::ranges::copy_if(kPolicyFigures, std::back_inserter(figures), [&](const PolicyFigure& figure) {
    return has_number(estimates, {.task = kOverall, .name = figure.name});
  });
  return figures;
}

// One engine: a column per figure.
TitledTable one_engine_table(const Estimates& estimates) {
  Pivot pivot{.title = "Policies",
              .rows = policy_rows(),
              .columns = {column("n", {.task = kOverall, .name = "success"}, as_n)}};
  for (const PolicyFigure& figure : figures_in(estimates))
    pivot.columns.push_back(column(figure.title, {.task = kOverall, .name = figure.name}, figure_text(figure)));
  return table_of(estimates, pivot);
}

std::vector<PivotColumn> over_engines_columns(const PolicyFigure& figure) {
  const bool is_success = std::string_view(figure.name) == "success";
  const std::string name = figure.name;
  const CellText text = figure.share ? as_share : figure_text(figure);
  return {is_success ? column("Mean", {.name = "mean_success"}, as_percent)
                     : column("Mean", {.name = name + "_mean"}, text),
          column("Spread", {.name = name + "_range"}, text),
          {"Worst", [name](const PivotRow& row) {
             const bool differ = row.value({.name = name + "_range"}) > 0.0;
             return differ ? row.find({.name = name + "_worst"})->engine : std::string("-");
           }}};
}

// Several engines: a column per engine.
TitledTable figure_table(const Estimates& estimates, const std::vector<std::string>& engines,
                         const PolicyFigure& figure) {
  Pivot pivot{.title = fmt::format("Policies: {}", figure.title),
              .rows = {{"Controller", &Estimate::controller}, {"Policy", &Estimate::policy, true}},
              .columns = {}};
  for (const std::string& engine : engines)
    pivot.columns.push_back(
        column(engine, {.engine = engine, .task = kOverall, .name = figure.name}, figure_text(figure)));
  const bool playback = engines.back() == kPlaybackEngine;
  if (engines.size() > (playback ? 2U : 1U))
    std::ranges::move(over_engines_columns(figure), std::back_inserter(pivot.columns));
  return table_of(estimates, pivot);
}

// Physics engines by name, then playback.
std::vector<std::string> engines_in(const std::map<PolicyKey, Estimates>& policies) {
  std::vector<std::string> engines;
  for (const auto& [key, estimates] : policies)
    if (engines.empty() || engines.back() != key.engine) engines.push_back(key.engine);
  std::stable_partition(engines.begin(), engines.end(),
                        [](const std::string& engine) { return engine != kPlaybackEngine; });
  return engines;
}

std::vector<TitledTable> headline_tables(const std::vector<std::string>& engines, Estimates by_line,
                                         const Estimates& over_engines, double level) {
  std::vector<TitledTable> tables;
  if (engines.size() == 1) {
    tables.push_back(one_engine_table(by_line));
  } else {
    const std::vector<PolicyFigure> figures = figures_in(by_line);
    by_line.insert(by_line.end(), over_engines.begin(), over_engines.end());
    for (const PolicyFigure& figure : figures) tables.push_back(figure_table(by_line, engines, figure));
  }
  tables.front().notes = {
      fmt::format(
          "Success in % of episodes without perturbation under the suite's headline detector, with {:g} % Wilson "
          "intervals. Lift: success minus that of the same episodes under the null arm, with Newcombe's paired "
          "interval. Over a contact limit: of the episodes with a solid partner whose contact forces were measured.",
          100.0 * level),
      paper_detector_sentence()};
  return tables;
}

// Overall, then each task.
std::vector<std::string> tasks_in(const Estimates& estimates) {
  std::vector<std::string> tasks = values_of(estimates, &Estimate::task);
  std::ranges::sort(tasks, {}, [](const std::string& of) { return std::tuple(of != kOverall, task_rank(of), of); });
  return tasks;
}

TitledTable task_table(const std::string& title, const char* name, const std::vector<std::string>& tasks,
                       const Estimates& estimates) {
  Pivot pivot{.title = title, .rows = policy_rows(), .columns = {}};
  for (const std::string& task : tasks)
    pivot.columns.push_back(column(task_title(task), {.task = task, .name = name}, as_percent));
  return table_of(estimates, pivot);
}

TitledTable papers_task_table(const std::vector<std::string>& tasks, Estimates estimates, const Estimates& papers) {
  estimates.insert(estimates.end(), papers.begin(), papers.end());
  TitledTable titled =
      task_table("Policies by task: the paper's detectors (Table S9)", "paper_success", tasks, estimates);
  titled.notes = {
      paper_detector_sentence(),
      "The paper's rows are Table S9 as printed: 126 episodes, as its percentages imply, of other clips, in "
      "a simulator that it does not name."};
  return titled;
}

TitledTable pairs_table(const Estimates& pairs, double level) {
  TitledTable titled = table_of(pairs, comparison_pivot([](const Estimate& of) {
                                  return fmt::format("{}/{}: {}", of.engine, of.controller, of.policy);
                                }));
  titled.title = "Policies against each other";
  titled.notes = {fmt::format(
      "The same episodes of one engine and controller under two policies, headline detector. A - B: points "
      "with Newcombe's paired {:g} % interval; by clip: bootstrap over clips, nowhere narrower than Newcombe's over "
      "so many clips. {} p (Holm): "
      "corrected for the {} comparisons here. MDE: the smallest difference, in points, that so many pairs with "
      "so much disagreement show in 80 % of runs.",
      100.0 * level, kPairedTests, titled.table.rows.size())};
  return titled;
}

}  // namespace

std::span<const PaperPolicy> paper_policies() { return kPaperPolicies; }

std::string paper_detector_sentence() {
  return "The paper's detectors watch the human and this suite's \"robot\" detectors the robot, so only success under "
         "the paper's detectors (paper/paper) can be held against the paper's figures.";
}

Analysis policy_analysis(const std::vector<EpisodeRow>& rows, const std::vector<LeaderboardEntry>& entries,
                         const IntervalOptions& options) {
  Analysis analysis{.name = "policies", .title = "Policies", .level = options.level};
  const std::map<PolicyKey, PerturbedRows> policies = rows_of_policies(rows);
  const std::map<PolicyKey, Estimates> clean = clean_estimates(entries, policies, options.level);
  if (clean.empty() || std::ranges::all_of(policies, [](const auto& of) { return of.first.policy == kReplay; })) {
    analysis.notes = {"No policy but replay ran."};
    return analysis;
  }
  Estimates &all = analysis.estimates, over_engines, by_line;
  const auto append = [](const Estimates& from, Estimates& to) { to.insert(to.end(), from.begin(), from.end()); };
  for (const auto& [key, estimates] : clean) append(estimates, all);
  const std::vector<std::string> tasks = tasks_in(all);
  for (const PolicyLine& line : lines_of(clean)) {
    for (const auto& [key, estimates] : line.engines) append(*estimates, by_line);
    const EstimatesOf of{line.keys, over_engines};
    add_mean(policies, line, options.level, of);
    for (const PolicyFigure& figure : kPolicyFigures) add_over_engines(line, figure, of);
  }
  analysis.tables = headline_tables(engines_in(clean), by_line, over_engines, options.level);
  std::vector<std::string>& notes = analysis.tables.front().notes;
  const std::map<std::string, long> could_not_run = policies_that_never_ran(entries);
  for (const auto& [policy, episodes] : could_not_run)
    notes.push_back(
        fmt::format("{} could not run ({} episodes) and is in no figure; its rows say why.", policy, episodes));
  for (std::string& fault : policy_fault_notes(entries)) notes.push_back(std::move(fault));
  if (engines_in(clean).size() > 1)
    notes.emplace_back(
        "Mean, spread (highest minus lowest) and worst are over the physics engines, each counting the same; playback "
        "is none. The interval of the mean success is Wilson's over clips and says nothing of other engines.");
  analysis.tables.push_back(task_table("Policies by task: headline detector", "success", tasks, all));
  Estimates papers;
  add_paper_policies(papers);
  if (has_number(all, {.name = "paper_success"})) analysis.tables.push_back(papers_task_table(tasks, all, papers));
  append(over_engines, all);
  if (const Estimates pairs = all_pairs(policies, options); !pairs.empty()) {
    analysis.tables.push_back(pairs_table(pairs, options.level));
    append(pairs, all);
  }
  for (const auto& [policy, episodes] : could_not_run)
    EstimatesOf{{.policy = policy}, all}.count("could_not_run", {}, episodes);
  append(papers, all);
  return analysis;
}

}  // namespace duet
