#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <tuple>

#include "duet/core/numbers.h"
#include "duet/core/task.h"
#include "duet/report/engines/cross_engine.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/studies/studies.h"

namespace duet {
namespace {

constexpr double kPass = 0.7;       // the lower end of a rung that is passed: 9 of 9, or 15 of 16
constexpr double kOfCommand = 0.5;  // of the forward speed that was asked for
// Mean over joints and time [rad]. In results/published/arena those that follow are off by .10 at most, the others by
// .13 and more.
constexpr double kArmsFollowed = 0.12;

// How an episode ends.
enum class Trial { kPassed, kFell, kError, kFailed, kSlow, kArmsElsewhere };

constexpr const char* why_not(Trial trial) {
  switch (trial) {
    case Trial::kFell:
      return "falls";
    case Trial::kSlow:
      return "too slow";
    case Trial::kArmsElsewhere:
      return "arms elsewhere";
    case Trial::kError:
      return "error";
    case Trial::kFailed:
      return "ends early";
    case Trial::kPassed:
      break;
  }
  return "too few episodes";
}

double metric_or(const EpisodeRow& row, const char* name, double otherwise) {
  const auto found = row.metrics.find(name);
  return found == row.metrics.end() ? otherwise : found->second;
}

// A robot without arms has no error of theirs.
Trial trial_of(const EpisodeRow& row) {
  if (row.fell) return Trial::kFell;
  if (row.outcome == Outcome::kError) return Trial::kError;
  if (!headline_success(row)) return Trial::kFailed;
  const double command = metric_or(row, "command_forward", 0.0);
  if (command > 0.0 && metric_or(row, "speed_forward", 0.0) < kOfCommand * command) return Trial::kSlow;
  const bool asks_for_arms = row.tags.text(row_tag(kOfClip, "arms")) == "followed";
  return asks_for_arms && metric_or(row, "upper_body_error", 0.0) > kArmsFollowed ? Trial::kArmsElsewhere
                                                                                  : Trial::kPassed;
}

// The rung of a row's perturbation, else of its clip.
std::optional<std::pair<int, std::string>> rung_of(const EpisodeRow& row) {
  for (const std::string_view of : {kOfPerturbation, kOfClip}) {
    const double rung = row.tags.number(row_tag(of, "rung"));
    if (rung >= 0.0 && rung == std::floor(rung))
      return std::pair(static_cast<int>(rung), row.tags.text(row_tag(of, "rung_name")));
  }
  return std::nullopt;
}

std::string rung_key(int rung, const std::string& name) { return fmt::format("rung_{}_{}", rung, name); }

std::string rung_title(int rung, std::string name) {
  std::ranges::replace(name, '_', ' ');
  return fmt::format("{} {}", rung, name);
}

using Trials = std::map<Trial, long>;

struct Entry {
  std::string engine, actuation, controller;
  auto operator<=>(const Entry&) const = default;
};

struct Rung {
  Rate rate;
  Trial commonest_failure = Trial::kPassed;

  [[nodiscard]] bool passed() const { return rate.n > 0 && rate.interval.low >= kPass; }
};

struct Standing {
  Entry entry;
  std::map<int, Rung> rungs;
  std::optional<int> reached, fails_at;  // the last rung up to which each is passed; the first that is not
  long passed = 0;
  double mean = 0.0;  // over rungs
};

Rung rung_of_trials(const Trials& trials, double level) {
  long n = 0, k = 0, most = 0;
  Rung rung;
  for (const auto& [trial, count] : trials) {
    n += count;
    if (trial == Trial::kPassed) k = count;
    if (trial == Trial::kPassed || count <= most) continue;
    most = count;
    rung.commonest_failure = trial;
  }
  rung.rate = {
      .n = n, .k = k, .rate = static_cast<double>(k) / static_cast<double>(n), .interval = wilson(k, n, level)};
  return rung;
}

Standing standing_of(const Entry& entry, const std::map<int, Trials>& trials, double level) {
  Standing standing;
  standing.entry = entry;
  for (const auto& [number, of_rung] : trials) {
    const Rung rung = standing.rungs[number] = rung_of_trials(of_rung, level);
    standing.mean += rung.rate.rate / static_cast<double>(trials.size());
    standing.passed += rung.passed() ? 1 : 0;
    if (!rung.passed() && !standing.fails_at) standing.fails_at = number;
    if (rung.passed() && !standing.fails_at) standing.reached = number;
  }
  return standing;
}

// Best first: by the rung that is reached, then by how many are passed at all, then by the mean.
auto merit_of(const Standing& standing) {
  return std::tuple(-standing.reached.value_or(-1), -standing.passed, -standing.mean);
}

// Best first in each engine and actuation.
auto place_of(const Standing& standing) {
  return std::tuple(standing.entry.engine, standing.entry.actuation, merit_of(standing), standing.entry.controller);
}

void add_standing(const Standing& standing, const std::map<int, std::string>& names, Estimates& into) {
  EstimatesOf of{{.engine = standing.entry.engine,
                  .controller = standing.entry.controller,
                  .perturbation = standing.entry.actuation},
                 into};
  for (const auto& [number, rung] : standing.rungs) {
    of.keys.of = rung_key(number, names.at(number));
    of.rate("passes", rung.rate);
  }
  of.keys.of = "rung";
  const auto rungs = static_cast<long>(standing.rungs.size());
  of.add("mean", rungs, standing.mean);
  of.count("passed", rungs, standing.passed);
  if (standing.reached) of.count("reached", rungs, *standing.reached);
  if (!standing.fails_at) return;
  const Rung& first = standing.rungs.at(*standing.fails_at);
  of.word("fails_at", fmt::format("{}: {}", rung_title(*standing.fails_at, names.at(*standing.fails_at)),
                                  why_not(first.commonest_failure)));
}

Pivot arena_pivot(const std::map<int, std::string>& names, double level) {
  Pivot pivot{.title = "Arena",
              .rows = {{"Engine", &Estimate::engine, true},
                       {"Actuation", &Estimate::perturbation, true},
                       {"Controller", &Estimate::controller, true}},
              .columns = {column("Reached", {.of = "rung", .name = "reached"}, as_count, "none"),
                          column("Fails first at", {.of = "rung", .name = "fails_at"}, as_word, "nowhere")}};
  for (const auto& [number, name] : names)
    pivot.columns.push_back(
        column(rung_title(number, name), {.of = rung_key(number, name), .name = "passes"}, as_k_of_n));
  pivot.columns.push_back(column("Mean [%]", {.of = "rung", .name = "mean"}, as_share));
  pivot.notes = {fmt::format(
      "Best first in each engine and actuation. An episode passes where the robot is upright at the end, walks at {:g} "
      "% "
      "of the speed that it is told or more, and, where its arms are asked for, has them within {:g} rad of where they "
      "are told on average. Reached: the last rung up to which the lower end of the {:g} % Wilson interval is {:g} % "
      "or "
      "more at each. Mean: over the rungs, each counting the same.",
      100.0 * kOfCommand, kArmsFollowed, 100.0 * level, 100.0 * kPass)};
  return pivot;
}

// A network that a public benchmark ran, too, the same file by its digest. survival: until it fell, of 90 s, the mean
// of its two engines. [s]
struct PublicStanding {
  std::string_view controller, theirs;
  double survival;
};
// Source: github.com/rhoyn/teleop-walking-benchmark, README at 0b2ea7a (MuJoCo and PhysX, 512 runs each but homie's
// 5120; its rl_mjlab is the file 2a66ca63, which g1_deploy ships, too).
constexpr std::array<PublicStanding, 6> kPublicStandings = {{{"homie", "homie", 78.6},
                                                             {"falcon_dec_loco", "falcon", 38.95},
                                                             {"unitree_rl_lab", "rl_lab", 24.35},
                                                             {"holosoma_fastsac", "holosoma", 6.15},
                                                             {"g1_deploy_velocity", "rl_mjlab", 5.45},
                                                             {"rl_gym", "rl_gym", 1.3}}};
constexpr const char* kPublicBenchmark = "teleop-walking-benchmark";
constexpr std::size_t kFewestRanked = 3;  // of fewer an order says nothing
constexpr int kOrderResamples = 10000, kAgreementResamples = 2000;
constexpr double kSaturated = 1e-9;  // a mean over rungs this near to 0 or 1

const PublicStanding* public_standing(std::string_view controller) {
  const auto found = std::ranges::find(kPublicStandings, controller, &PublicStanding::controller);
  return found == kPublicStandings.end() ? nullptr : &*found;
}

// Kendall's tau-b of the board's order, best first, with the benchmark's over the networks of both; networks are drawn
// again for its interval. `board`: of one engine and actuation.
void add_order(std::span<const Standing> board, double level, Estimates& into) {
  std::vector<double> ours, theirs;
  std::vector<int> numbers;
  for (const Standing& standing : board) {
    const PublicStanding* found = public_standing(standing.entry.controller);
    if (found == nullptr) continue;
    const auto better = [&](const Standing& other) { return merit_of(other) < merit_of(standing); };
    ours.push_back(-static_cast<double>(std::ranges::count_if(board, better)));
    theirs.push_back(found->survival);
    numbers.push_back(static_cast<int>(numbers.size()));
  }
  if (ours.size() < kFewestRanked) return;
  const auto drawn_again = [&](std::span<const double> times) {
    std::vector<double> a, b;
    for (std::size_t i = 0; i < times.size(); ++i) {
      a.insert(a.end(), static_cast<std::size_t>(times[i]), ours[i]);
      b.insert(b.end(), static_cast<std::size_t>(times[i]), theirs[i]);
    }
    return kendall(a, b).tau_b;
  };
  const RankAgreement agreement = kendall(ours, theirs);
  const Entry& entry = board.front().entry;
  const EstimatesOf of{{.engine = entry.engine, .perturbation = entry.actuation, .of = "public_order"}, into};
  of.add("tau_b", static_cast<long>(ours.size()), agreement.tau_b,
         ClusterBootstrap(kOrderResamples, 1).weighted(numbers, drawn_again, level));
  of.count("swapped", agreement.pairs, agreement.discordant);
}

Pivot order_pivot(double level) {
  std::vector<std::string> theirs;
  theirs.reserve(kPublicStandings.size());
  for (const PublicStanding& each : kPublicStandings)
    theirs.push_back(fmt::format("{} ({:.1f} s)", each.controller, each.survival));
  Pivot pivot{.title = fmt::format("Arena: the order beside {}", kPublicBenchmark),
              .rows = {{"Engine", &Estimate::engine, true}, {"Actuation", &Estimate::perturbation, true}},
              .columns = {column("Networks", {.of = "public_order", .name = "tau_b"}, as_n),
                          column("tau-b", {.of = "public_order", .name = "tau_b"}, as_decimals(2)),
                          column("Swapped pairs", {.of = "public_order", .name = "swapped"}, as_count_of_n)}};
  pivot.notes = {fmt::format(
      "Kendall's tau-b of this board's order with that of {}, over the networks (by digest) of both: 1 the same order, "
      "-1 the reverse. Its order is by the time until a fall under growing punches, the arms moved by the harness: {}. "
      "Interval: {:g} %, networks drawn again.",
      kPublicBenchmark, fmt::join(theirs, ", "), 100.0 * level)};
  return pivot;
}

// The boards of engines and actuations, one after another.
void add_orders(const std::vector<Standing>& standings, double level, Estimates& into) {
  for (auto begin = standings.begin(); begin != standings.end();) {
    const auto of_another = [&](const Standing& standing) {
      return std::tie(standing.entry.engine, standing.entry.actuation) !=
             std::tie(begin->entry.engine, begin->entry.actuation);
    };
    const auto end = std::find_if(begin, standings.end(), of_another);
    add_order({begin, end}, level, into);
    begin = end;
  }
  if (into.empty()) return;
  for (const PublicStanding& each : kPublicStandings)
    EstimatesOf{{.source = kPublicBenchmark, .controller = std::string(each.controller), .of = "public_order"}, into}
        .add("survival", {}, each.survival, kNoInterval, "s");
}

// The means over rungs of the controllers that ran in all engines of an actuation, one list for each engine; those that
// every engine puts at 0 or every engine at 1 are left out.
struct EngineMeans {
  std::vector<std::vector<double>> of_engine;
  long saturated = 0;

  [[nodiscard]] std::size_t controllers() const { return of_engine.empty() ? 0 : of_engine.front().size(); }
};

EngineMeans engine_means(const std::vector<Standing>& standings, const std::string& actuation) {
  std::set<std::string> engines;
  std::map<std::string, std::vector<double>> means;  // of a controller, by engine, as `standings` are sorted
  for (const Standing& standing : standings) {
    if (standing.entry.actuation != actuation) continue;
    engines.insert(standing.entry.engine);
    means[standing.entry.controller].push_back(standing.mean);
  }
  EngineMeans result;
  result.of_engine.resize(engines.size());
  for (const auto& [controller, of] : means) {
    if (of.size() != engines.size()) continue;
    const auto [least, most] = std::ranges::minmax(of);
    if (most < kSaturated || least > 1.0 - kSaturated) {
      ++result.saturated;
      continue;
    }
    for (std::size_t i = 0; i < of.size(); ++i) result.of_engine[i].push_back(of[i]);
  }
  return result;
}

using PairFigure = double (*)(std::span<const double>, std::span<const double>);

double tau_b_of(std::span<const double> a, std::span<const double> b) { return kendall(a, b).tau_b; }

// The figure of every two engines, each controller as often as `times` says.
std::vector<double> of_pairs(const EngineMeans& means, std::span<const double> times, PairFigure figure) {
  std::vector<std::vector<double>> drawn(means.of_engine.size());
  for (std::size_t engine = 0; engine < drawn.size(); ++engine)
    for (std::size_t i = 0; i < times.size(); ++i)
      drawn[engine].insert(drawn[engine].end(), static_cast<std::size_t>(times[i]), means.of_engine[engine][i]);
  std::vector<double> figures;
  figures.reserve(drawn.size() * drawn.size() / 2);
  for (std::size_t a = 0; a < drawn.size(); ++a)
    for (std::size_t b = a + 1; b < drawn.size(); ++b) figures.push_back(figure(drawn[a], drawn[b]));
  return figures;
}

void add_agreement(const std::vector<Standing>& standings, const std::string& actuation, double level,
                   Estimates& into) {
  const EngineMeans means = engine_means(standings, actuation);
  if (means.of_engine.size() < 2 || means.controllers() < kFewestRanked) return;
  std::vector<int> numbers(means.controllers());
  std::iota(numbers.begin(), numbers.end(), 0);
  const EstimatesOf of{{.engine = "all", .perturbation = actuation, .of = "engines"}, into};
  const auto add_mean = [&](const char* name, const std::vector<double>& found, PairFigure figure) {
    const auto drawn_again = [&](std::span<const double> times) { return mean_of(of_pairs(means, times, figure)); };
    of.add(name, static_cast<long>(found.size()), mean_of(found),
           ClusterBootstrap(kAgreementResamples, 1).weighted(numbers, drawn_again, level));
  };
  const std::vector<double> once(numbers.size(), 1.0), tau_b = of_pairs(means, once, tau_b_of);
  of.count("controllers", {}, static_cast<long>(numbers.size()));
  of.count("saturated", {}, means.saturated);
  add_mean("mean_tau_b", tau_b, tau_b_of);
  of.add("lowest_tau_b", static_cast<long>(tau_b.size()), std::ranges::min(tau_b));
  add_mean("rank_violation", of_pairs(means, once, rank_violation_of_both), rank_violation_of_both);
}

Pivot agreement_pivot(double level) {
  Pivot pivot{.title = "Arena: whether engines rank alike",
              .rows = {{"Actuation", &Estimate::perturbation, true}},
              .columns = {column("Controllers", {.of = "engines", .name = "controllers"}, as_count),
                          column("Pairs of engines", {.of = "engines", .name = "mean_tau_b"}, as_n),
                          column("Mean tau-b", {.of = "engines", .name = "mean_tau_b"}, as_decimals(2)),
                          column("Lowest", {.of = "engines", .name = "lowest_tau_b"}, as_decimals(2)),
                          column("Rank violation [%]", {.of = "engines", .name = "rank_violation"}, as_percent),
                          column("Saturated", {.of = "engines", .name = "saturated"}, as_count)}};
  pivot.notes = {fmt::format(
      "Kendall's tau-b of two engines' orders of the controllers that ran in all of them, by the mean over rungs: 1 "
      "the "
      "same order, -1 the reverse. Rank violation: what taking the other engine's order costs (SIMPLER's mean "
      "maximum). "
      "Saturated: all engines at 0 or all at 1, left out, because they agree whatever the order. Intervals: {:g} %, "
      "controllers drawn again.",
      100.0 * level)};
  return pivot;
}

}  // namespace

Analysis arena_analysis(const std::vector<EpisodeRow>& rows, double level) {
  std::map<Entry, std::map<int, Trials>> entries;
  std::map<int, std::string> names;
  std::set<std::string> ran, absent;
  std::map<std::string, std::vector<std::string>> errors;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    const auto rung = rung_of(*row);
    if (!rung || row->engine == kPlaybackEngine) continue;
    const bool runs = row->outcome != Outcome::kUnsupported;
    (runs ? ran : absent).insert(row->controller);
    if (!runs) continue;
    if (row->outcome == Outcome::kError) errors[row->controller].push_back(row->message);
    const std::string& actuation = row->tags.text(row_tag(kOfPerturbation, "actuation"));
    ++entries[{row->engine, actuation, row->controller}][rung->first][trial_of(*row)];
    names.insert(*rung);
  }
  Analysis analysis{.name = "arena", .title = "Arena", .level = level, .opens = true};
  std::vector<Standing> standings;
  standings.reserve(entries.size());
  for (const auto& [entry, trials] : entries) standings.push_back(standing_of(entry, trials, level));
  std::ranges::sort(standings, {}, place_of);
  for (const Standing& standing : standings) add_standing(standing, names, analysis.estimates);
  if (analysis.empty()) {
    analysis.notes = {"No episode of these results stands on a rung."};
    return analysis;
  }
  Pivot pivot = arena_pivot(names, level);
  std::erase_if(absent, [&](const std::string& controller) { return ran.contains(controller); });
  if (!absent.empty())
    pivot.notes.push_back(fmt::format("Not run on this machine, as their rows say: {}.", fmt::join(absent, ", ")));
  for (const auto& [controller, messages] : errors)
    pivot.notes.push_back(fmt::format("{}: {} ended with an error, the first: {}", controller,
                                      counted(static_cast<long>(messages.size()), "episode"),
                                      escape_markdown(messages.front())));
  analysis.tables = {table_of(analysis.estimates, pivot)};
  Estimates orders, agreement;
  add_orders(standings, level, orders);
  std::set<std::string> actuations;
  for (const Standing& standing : standings) actuations.insert(standing.entry.actuation);
  for (const std::string& actuation : actuations) add_agreement(standings, actuation, level, agreement);
  const auto add_table = [&](const Estimates& of, const Pivot& pivot) {
    if (of.empty()) return;
    analysis.tables.push_back(table_of(of, pivot));
    analysis.estimates.insert(analysis.estimates.end(), of.begin(), of.end());
  };
  add_table(orders, order_pivot(level));
  add_table(agreement, agreement_pivot(level));
  return analysis;
}

}  // namespace duet
