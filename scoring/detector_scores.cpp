#include "duet/scoring/detector_scores.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/metrics/detector_catalogue.h"
#include "duet/report/tables/text_table.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

std::vector<std::string> views_of(const std::vector<DetectorScore>& scores) {
  std::vector<std::string> views;
  for (const DetectorScore& score : scores)
    if (std::find(views.begin(), views.end(), score.view) == views.end()) views.push_back(score.view);
  return views;
}

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.4g}", value) : "-"; }
std::string margin(double value) { return std::isfinite(value) ? fmt::format("{:+.4g}", value) : "too few frames"; }

// The scores of one task, one per view.
using Row = std::vector<const DetectorScore*>;

// A row of the table: what, its unit, the threshold, and a cell for each view.
template <typename Cell>
void add_row(TextTable& table, const Row& scores, const std::string& title, const std::string& unit,
             const std::string& threshold, Cell&& cell) {
  std::vector<std::string> row = {title, unit, threshold};
  for (const DetectorScore* score : scores) row.push_back(cell(score->result));
  table.rows.push_back(std::move(row));
}

template <typename Map, typename Show>
std::string shown_entry(const Map& map, const std::string& key, Show&& show) {
  const auto found = map.find(key);
  return found == map.end() ? "" : show(found->second);
}

void add_task(TextTable& table, const Row& scores) {
  const DetectorScore& first = *scores.front();
  const auto yes_no = [](bool holds) { return std::string(holds ? "yes" : "no"); };
  add_row(table, scores, std::string(to_string(first.task)), "", "",
          [&](const DetectorResult& r) { return yes_no(r.success); });
  for (const auto& [name, holds] : first.result.parts)
    add_row(table, scores, "  " + name, "", "",
            [&, &name = name](const DetectorResult& r) { return shown_entry(r.parts, name, yes_no); });
  for (const auto& [name, value] : first.result.values)
    add_row(table, scores, "  " + name, std::string(detector_figure(first.task, name, first.thresholds).unit), "",
            [&, &name = name](const DetectorResult& r) { return shown_entry(r.values, name, number); });
  const Thresholds tau = thresholds(first.task, first.thresholds);
  for (const auto& [name, value] : tau)
    add_row(table, scores, "  margin of " + name, std::string(threshold_unit(first.task, name, first.thresholds)),
            number(value), [&, &name = name](const DetectorResult& r) { return shown_entry(r.margins, name, margin); });
  add_row(table, scores, "  evidence_frames", "frames", "",
          [](const DetectorResult& r) { return std::to_string(std::count(r.frames.begin(), r.frames.end(), true)); });
}

TextTable table_of(const std::vector<std::string>& titles, const std::vector<std::string>& views) {
  TextTable table{.header = titles, .rows = {}, .label_columns = titles.size()};
  table.header.insert(table.header.end(), views.begin(), views.end());
  return table;
}

Row of_task(const std::vector<DetectorScore>& scores, Task task) {
  Row row;
  for (const DetectorScore& score : scores)
    if (score.task == task) row.push_back(&score);
  return row;
}

}  // namespace

std::vector<DetectorView> robot_views(const Recording& recording, const RobotModel& robot) {
  if (recording.partner.empty()) return {};
  const Agent human = human_agent(recording.partner), machine = robot_agent(robot, recording.robot);
  return {{"robot", human, machine, DetectorVersion::kRobot}, {"printed", human, machine, DetectorVersion::kPaper}};
}

std::vector<DetectorScore> score_detectors(const std::vector<Task>& tasks, const std::vector<DetectorView>& views,
                                           ThresholdSet thresholds, const DetectorReadings& readings) {
  std::vector<DetectorScore> scores;
  for (const Task task : tasks)
    for (const DetectorView& view : views)
      scores.push_back(
          {task, view.name, thresholds, detect(task, view.human, view.robot, view.version, thresholds, readings)});
  return scores;
}

std::string detectors_table(const std::vector<DetectorScore>& scores) {
  TextTable table = table_of({"detector", "unit", "threshold"}, views_of(scores));
  for (const Task task : all_tasks())
    if (const Row row = of_task(scores, task); !row.empty()) add_task(table, row);
  return table.rows.empty() ? "" : markdown_table(table);
}

std::string acceptance_table(const std::map<std::string, std::vector<std::vector<DetectorScore>>>& clips) {
  if (clips.empty()) return "";
  const std::vector<std::string> views = views_of(clips.begin()->second.front());
  TextTable table = table_of({"clips", "detector accepts"}, views);
  for (const auto& [clip_task, scores_of_clips] : clips) {
    for (const Task task : all_tasks()) {
      std::map<std::string, int> accepted;
      for (const std::vector<DetectorScore>& scores : scores_of_clips)
        for (const DetectorScore* score : of_task(scores, task)) accepted[score->view] += score->result.success ? 1 : 0;
      std::vector<std::string> row = {clip_task, std::string(to_string(task))};
      for (const std::string& view : views)
        row.push_back(fmt::format("{} of {}", accepted[view], scores_of_clips.size()));
      table.rows.push_back(std::move(row));
    }
  }
  return markdown_table(table);
}

nlohmann::json detectors_json(const std::vector<DetectorScore>& scores) {
  nlohmann::json json = nlohmann::json::object();
  for (const DetectorScore& score : scores) {
    const DetectorResult& result = score.result;
    json[std::string(to_string(score.task))][score.view] = {
        {"success", result.success},
        {"parts", result.parts.map()},
        {"values", numbers_or_null(result.values.map())},
        {"thresholds", numbers_or_null(thresholds(score.task, score.thresholds))},
        {"margins", numbers_or_null(result.margins.map())},
        {"evidence_frames", std::count(result.frames.begin(), result.frames.end(), true)}};
  }
  return json;
}

}  // namespace duet
