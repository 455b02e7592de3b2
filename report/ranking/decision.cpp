#include "duet/report/ranking/decision.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

using Cell = std::tuple<std::string, std::string, std::string>;  // engine, controller, perturbation

struct Successes {
  long n = 0, k = 0;
  [[nodiscard]] double rate() const { return static_cast<double>(k) / static_cast<double>(n); }
};

using CellsOfPolicy = std::map<std::string, std::map<Cell, Successes>>;
using CellsOfClip = std::map<TaskClip, CellsOfPolicy>;

bool has_physics(const std::vector<EpisodeRow>& rows) {
  return std::ranges::any_of(rows, [](const EpisodeRow& row) { return row.engine != kPlaybackEngine; });
}

CellsOfClip gather_cells(const std::vector<EpisodeRow>& rows) {
  const bool physics = has_physics(rows);
  CellsOfClip cells;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->arm == "null" || row->outcome == Outcome::kUnsupported) continue;
    if (physics && row->engine == kPlaybackEngine) continue;
    Successes& of = cells[{row->task, row->clip}][row->policy][{row->engine, row->controller, row->perturbation}];
    ++of.n;
    of.k += headline_success(*row) ? 1 : 0;
  }
  return cells;
}

// A minus B over the cells that both have; nothing where there are none.
std::optional<double> difference_in(const CellsOfPolicy& clip, const std::string& a, const std::string& b) {
  const auto of_a = clip.find(a), of_b = clip.find(b);
  if (of_a == clip.end() || of_b == clip.end()) return std::nullopt;
  double sum = 0.0;
  long cells = 0;
  for (const auto& [cell, successes] : of_a->second) {
    const auto other = of_b->second.find(cell);
    if (other == of_b->second.end()) continue;
    sum += successes.rate() - other->second.rate();
    ++cells;
  }
  if (cells == 0) return std::nullopt;
  return sum / static_cast<double>(cells);
}

// One observation per task: the mean over its clips of this round.
std::vector<double> observations_of(const std::vector<TaskClip>& round, const CellsOfClip& cells, PairDecision& pair) {
  std::map<std::string, std::pair<double, long>> tasks;
  for (const TaskClip& clip : round) {
    const auto found = cells.find(clip);
    if (found == cells.end()) continue;
    const std::optional<double> difference = difference_in(found->second, pair.a, pair.b);
    if (!difference.has_value()) continue;
    auto& [sum, count] = tasks[clip.first];
    sum += *difference;
    ++count;
    ++pair.clips;
    pair.better += *difference > 0.0 ? 1 : 0;
    pair.worse += *difference < 0.0 ? 1 : 0;
  }
  std::vector<double> observations;
  observations.reserve(tasks.size());
  for (const auto& [task, of] : tasks) observations.push_back(of.first / static_cast<double>(of.second));
  return observations;
}

PairDecision decide_pair(PairDecision pair, const CellsOfClip& cells, const std::vector<std::vector<TaskClip>>& rounds,
                         const std::vector<long>& looks, const DecisionOptions& options) {
  SequentialTest test;
  const double alpha = options.alpha / static_cast<double>(options.policies.size() - 1);
  for (const long look : looks) {
    for (; pair.rounds < look; ++pair.rounds)
      test.add_round(observations_of(rounds[static_cast<std::size_t>(pair.rounds)], cells, pair));
    pair.difference = test.difference();
    pair.interval = test.interval(alpha);
    pair.e_value = test.e_value();
    pair.p = test.anytime_p();
    pair.verdict = verdict_of(pair.interval, options.min_effect);
    if (pair.verdict != SequentialDecision::kUndecided) break;
  }
  return pair;
}

std::string judgement(const PairDecision& pair) {
  switch (pair.verdict) {
    case SequentialDecision::kUndecided:
      break;
    case SequentialDecision::kBetter:
    case SequentialDecision::kWorse:
      return fmt::format("{} is {} than {}", pair.a, to_string(pair.verdict), pair.b);
    case SequentialDecision::kSame:
      return fmt::format("{} and {} are the {}", pair.a, pair.b, to_string(pair.verdict));
  }
  return fmt::format("{} against {} is undecided", pair.a, pair.b);
}

std::string sentence(const PairDecision& pair, double alpha) {
  if (pair.clips == 0) return fmt::format("{}: no clip has an episode of both\n", judgement(pair));
  return fmt::format(
      "{}: {:+.1f} points [{:.1f}, {:.1f}] ({:g} %, valid at every look), e-value {:.3g}, anytime p {:.3g}, {} clips, "
      "of which {} favour {} and {} {}\n",
      judgement(pair), 100.0 * pair.difference + 0.0, 100.0 * pair.interval.low, 100.0 * pair.interval.high,
      100.0 * (1.0 - alpha), pair.e_value, pair.p, pair.clips, pair.better, pair.a, pair.worse, pair.b);
}

}  // namespace

void check_decision(const DecisionOptions& options) {
  require(options.policies.size() >= 2, "a decision: expected two policies or more, found {}", options.policies.size());
  require(std::set<std::string>(options.policies.begin(), options.policies.end()).size() == options.policies.size(),
          "a decision: expected each policy once");
  require(options.alpha > 0.0 && options.alpha < 1.0, "alpha: expected a number in (0, 1), found {}", options.alpha);
  require(options.min_effect > 0.0 && options.min_effect < 1.0,
          "min-effect: expected more than 0 and less than 100 points, found {:g}", 100.0 * options.min_effect);
}

std::vector<std::vector<TaskClip>> decision_rounds(const std::vector<TaskClip>& clips, std::uint64_t seed) {
  std::map<std::string, std::vector<std::string>> tasks;
  for (const auto& [task, clip] : clips) tasks[task].push_back(clip);
  std::size_t count = clips.size();
  for (auto& [task, of] : tasks) {
    std::sort(of.begin(), of.end());
    Random random(seed, stream_key({"decision_rounds", task}));
    for (std::size_t i = of.size(); i > 1; --i)
      std::swap(of[i - 1], of[static_cast<std::size_t>(random.below(static_cast<int>(i)))]);
    count = std::min(count, of.size());
  }
  std::vector<std::vector<TaskClip>> rounds(count);
  for (const auto& [task, of] : tasks)
    for (std::size_t i = 0; i < of.size(); ++i) rounds[i * count / of.size()].emplace_back(task, of[i]);
  return rounds;
}

bool Decision::is_decided() const {
  return std::ranges::none_of(pairs,
                              [](const PairDecision& pair) { return pair.verdict == SequentialDecision::kUndecided; });
}

bool Decision::is_open(const std::string& policy) const {
  return std::ranges::any_of(pairs, [&](const PairDecision& pair) {
    return pair.verdict == SequentialDecision::kUndecided && (pair.a == policy || pair.b == policy);
  });
}

Decision decide(const std::vector<EpisodeRow>& rows, const std::vector<std::vector<TaskClip>>& rounds,
                const std::vector<long>& looks, const DecisionOptions& options) {
  check_decision(options);
  require(std::is_sorted(looks.begin(), looks.end()) &&
              (looks.empty() || (looks.front() >= 0 && looks.back() <= static_cast<long>(rounds.size()))),
          "looks: expected rising numbers of at most {} rounds", rounds.size());
  const CellsOfClip cells = gather_cells(rows);
  Decision decision{.options = options, .pairs = {}};
  decision.pairs.reserve(options.policies.size() - 1);
  for (std::size_t i = 1; i < options.policies.size(); ++i) {
    PairDecision pair{.a = options.policies.front(), .b = options.policies[i]};
    pair.difference = std::numeric_limits<double>::quiet_NaN();
    pair.interval = {.low = -1.0, .high = 1.0};
    decision.pairs.push_back(decide_pair(std::move(pair), cells, rounds, looks, options));
  }
  return decision;
}

std::string decision_text(const Decision& decision) {
  std::string text;
  const double alpha = decision.options.alpha / static_cast<double>(decision.pairs.size());
  for (const PairDecision& pair : decision.pairs) text += sentence(pair, alpha);
  return text;
}

nlohmann::json decision_json(const Decision& decision) {
  nlohmann::json pairs = nlohmann::json::array();
  for (const PairDecision& pair : decision.pairs) {
    pairs.push_back({{"a", pair.a},
                     {"b", pair.b},
                     {"verdict", std::string(to_string(pair.verdict))},
                     {"rounds", pair.rounds},
                     {"clips", pair.clips},
                     {"better", pair.better},
                     {"worse", pair.worse},
                     {"difference", number_or_null(pair.difference)},
                     {"interval", json_of(pair.interval)},
                     {"e_value", number_or_null(pair.e_value)},
                     {"p", number_or_null(pair.p)}});
  }
  return {{"schema", "duet.decision/1"},
          {"policies", decision.options.policies},
          {"alpha", decision.options.alpha},
          {"min_effect", decision.options.min_effect},
          {"pairs", std::move(pairs)}};
}

}  // namespace duet
