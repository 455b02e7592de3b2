#include "duet/results/analyses/reactivity.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "duet/core/order_statistics.h"
#include "duet/results/statistics/row_groups.h"

namespace duet {
namespace {

constexpr double kNoReaction = std::numeric_limits<double>::quiet_NaN();

struct Onsets {
  double robot = kNoReaction, partner = kNoReaction;  // [s]; NaN: none

  [[nodiscard]] bool both() const { return std::isfinite(robot) && std::isfinite(partner); }
  [[nodiscard]] double delay() const { return robot - partner; }
};

Onsets onsets_of(const EpisodeRow& row) {
  const auto metric = [&](const char* name) {
    const auto found = row.metrics.find(name);
    return found == row.metrics.end() ? kNoReaction : found->second;
  };
  return {.robot = metric("onset_s"), .partner = metric("partner_onset_s")};
}

// What is gathered of one policy before its figures are computed.
struct Gathered {
  std::vector<double> products, squares;  // robot's times partner's shift, partner's squared
  std::vector<int> clips;
  std::map<std::pair<std::string, std::string>, int> numbers;
  std::vector<double> delays;
  long without = 0;

  void add(const EpisodeId& id, double robot, double partner) {
    products.push_back(robot * partner);
    squares.push_back(partner * partner);
    clips.push_back(numbers.try_emplace({id.task, id.clip}, static_cast<int>(numbers.size())).first->second);
  }
};

OnsetShift gather(const std::string& perturbation, const EpisodeRows& perturbed, const EpisodeRows& clean,
                  Gathered& gathered) {
  OnsetShift shift{.perturbation = perturbation};
  for (const auto& [id, row] : perturbed) {
    const auto found = clean.find(id);
    if (found == clean.end()) continue;
    const Onsets now = onsets_of(*row);
    const Onsets before = onsets_of(*found->second);
    const double partner = now.partner - before.partner;
    if (!(std::abs(partner) >= kPartnerShift)) continue;
    if (!now.both() || !before.both()) {
      ++gathered.without;
      continue;
    }
    const double robot = now.robot - before.robot;
    gathered.add(id, robot, partner);
    gathered.delays.push_back(now.delay());
    ++shift.n;
    shift.partner += partner;
    shift.robot += robot;
  }
  if (shift.n == 0) return shift;
  shift.partner /= static_cast<double>(shift.n);
  shift.robot /= static_cast<double>(shift.n);
  return shift;
}

double sum(const std::vector<double>& values) {
  double total = 0.0;
  for (const double value : values) total += value;
  return total;
}

std::vector<double> clean_delays(const EpisodeRows& rows) {
  std::vector<double> delays;
  for (const auto& [id, row] : rows)
    if (const Onsets onsets = onsets_of(*row); onsets.both()) delays.push_back(onsets.delay());
  return delays;
}

Reactivity timing_of(const PolicyKey& key, const PerturbedRows& rows, ClusterBootstrap& bootstrap, double level) {
  const EpisodeRows& clean = rows.find(kClean)->second;
  Reactivity of;
  of.key = key;
  Gathered gathered;
  for (const auto& [perturbation, episodes] : rows) {
    if (perturbation == kClean) continue;
    OnsetShift shift = gather(perturbation, episodes, clean, gathered);
    if (shift.n > 0) of.shifts.push_back(std::move(shift));
  }
  std::stable_sort(of.shifts.begin(), of.shifts.end(),
                   [](const OnsetShift& a, const OnsetShift& b) { return a.partner < b.partner; });
  of.n = static_cast<long>(gathered.products.size());
  of.without = gathered.without;
  of.slope = of.n > 0 ? sum(gathered.products) / sum(gathered.squares) : kNoReaction;
  of.interval = gathered.numbers.size() > 1
                    ? bootstrap.ratio(gathered.products, gathered.squares, gathered.clips, level)
                    : Interval{.low = kNoReaction, .high = kNoReaction};
  std::vector<double> delays = clean_delays(clean);
  of.n_clean = static_cast<long>(delays.size());
  of.delay_clean = quantile(std::move(delays), 0.5);
  of.delay_moved = quantile(std::move(gathered.delays), 0.5);
  return of;
}

std::vector<SpatialCells> spatial_of(const PolicyKey& key, const EpisodeRows& rows, double level) {
  std::map<std::pair<int, std::string>, std::array<EpisodeRows, 4>> tasks;
  for (const auto& [id, row] : rows) {
    const int cell = spatial_cell(id.clip);
    if (cell >= 0) tasks[{task_rank(id.task), id.task}][static_cast<std::size_t>(cell)].emplace(id, row);
  }
  std::vector<SpatialCells> spatial;
  for (const auto& [task, cells] : tasks) {
    SpatialCells of{.key = key, .task = task.second, .cells = {}};
    for (std::size_t i = 0; i < cells.size(); ++i) of.cells[i] = headline_rate(cells[i], level);
    spatial.push_back(std::move(of));
  }
  return spatial;
}

}  // namespace

int spatial_cell(std::string_view clip) {
  while (!clip.empty()) {
    const std::size_t hyphen = std::min(clip.find('-'), clip.size());
    const std::string_view word = clip.substr(0, hyphen);
    for (std::size_t i = 0; i < kSpatialCells.size(); ++i)
      if (kSpatialCells[i].variant == word) return static_cast<int>(i);
    clip.remove_prefix(std::min(hyphen + 1, clip.size()));
  }
  return -1;
}

ReactivityTable reactivity_table(const std::vector<EpisodeRow>& rows, const PolicyTableOptions& options) {
  ReactivityTable table{.level = options.level, .timing = {}, .spatial = {}};
  ClusterBootstrap bootstrap(options.resamples, options.seed);
  for (const auto& [key, perturbed] : rows_of_policies(rows)) {
    const auto clean = perturbed.find(kClean);
    if (clean == perturbed.end()) continue;
    Reactivity timing = timing_of(key, perturbed, bootstrap, options.level);
    if (timing.n + timing.without > 0) table.timing.push_back(std::move(timing));
    for (SpatialCells& cells : spatial_of(key, clean->second, options.level)) table.spatial.push_back(std::move(cells));
  }
  return table;
}

}  // namespace duet
