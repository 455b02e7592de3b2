#include "duet/report/page/foot_plots.h"

#include <fmt/format.h>

#include <map>

#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

std::vector<double> metres(const std::vector<int>& millimetres) {
  std::vector<double> values;
  values.reserve(millimetres.size());
  for (const int value : millimetres) values.push_back(value / 1000.0);
  return values;
}

// An episode that ended well before one that did not, a clean one before a perturbed one; else the first.
bool shows_better(const EpisodeRow& a, const EpisodeRow& b) {
  const auto rank = [](const EpisodeRow& row) {
    return (row.outcome == Outcome::kOk ? 0 : 2) + (row.perturbation == "clean" ? 0 : 1);
  };
  return rank(a) < rank(b);
}

}  // namespace

std::vector<LinePlot> foot_plots(const std::vector<EpisodeRow>& rows, const RowFile& file) {
  std::map<std::string, const EpisodeRow*> shown;  // by controller
  for (const EpisodeRow* row : in_episode_order(rows)) {
    if (row->feet.left_mm.empty() || row->arm != "main") continue;
    const auto [found, is_new] = shown.try_emplace(row->controller, row);
    if (!is_new && shows_better(*row, *found->second)) found->second = row;
  }
  std::vector<LinePlot> plots;
  for (const auto& [controller, row] : shown) {
    const FootTrace feet = file.feet(*row);
    std::vector<double> seconds;
    for (std::size_t i = 0; i < feet.left_mm.size(); ++i) seconds.push_back(static_cast<double>(i) / feet.rate_hz);
    plots.push_back(
        {.title = fmt::format("{}: {} in {}, {} policy{}", controller, row->clip, row->engine, row->policy,
                              row->perturbation == "clean" ? "" : ", " + row->perturbation),
         .x_label = "time [s]",
         .y_label = "height of the sole [m]",
         .series = {{"left foot", seconds, metres(feet.left_mm)}, {"right foot", seconds, metres(feet.right_mm)}}});
  }
  return plots;
}

}  // namespace duet
