#include "duet/scoring/motion_scores.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "duet/core/machine.h"
#include "duet/metrics/catalogue.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/locomotion.h"
#include "duet/metrics/retargeting.h"
#include "duet/report/tables/text_table.h"
#include "duet/robots/kinematics.h"
#include "duet/rollout/world.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr std::array<const char*, 3> kThresholdNames = {"0.2", "0.35", "0.5"};
const std::vector<std::pair<std::string, std::string>>& detector_rows() {
  static const std::vector<std::pair<std::string, std::string>> rows = {
      {"source_detected", "task detected, people"},
      {"robot_detected", "task detected, robot"},
      {"paper_detected", "task detected, as printed"}};
  return rows;
}

// The robot's points of the 16 pairs over time.
PointTracks pair_tracks(const RobotMotion& motion, const RobotModel& robot) {
  std::vector<int> frames;
  for (const RetargetPair& pair : robot.pairs) frames.push_back(pair.frame);
  return frame_tracks(robot, motion, frames);
}

// Mean over the clips that have a value.
double mean_of(const std::vector<const ClipScore*>& scores, const std::string& metric) {
  double sum = 0.0;
  int count = 0;
  for (const ClipScore* score : scores) {
    const auto found = score->metrics.find(metric);
    if (found == score->metrics.end() || !std::isfinite(found->second)) continue;
    sum += found->second;
    ++count;
  }
  return count > 0 ? sum / count : std::nan("");
}

std::map<std::string, double> summarize(const std::vector<const ClipScore*>& scores, const MetricReadings& readings) {
  std::map<std::string, double> row;
  std::array<ContactCounts, 3> counts{}, object_counts{};
  bool object = false;
  std::set<std::string> names;
  for (const ClipScore* score : scores) {
    object = object || score->metrics.contains("object_distance_error");
    for (const auto& [name, value] : score->metrics) names.insert(name);
    for (size_t i = 0; i < counts.size(); ++i) {
      counts[i] += score->contacts[i];
      object_counts[i] += score->object_contacts[i];
    }
    row["source_detected"] += score->source_detected;
    row["robot_detected"] += score->robot_detected;
    row["paper_detected"] += score->paper_detected;
  }
  for (const std::string& name : names) row[name] = mean_of(scores, name);
  for (const auto& [name, title] : detector_rows()) row[name] /= static_cast<double>(scores.size());
  for (size_t i = 0; i < counts.size(); ++i) {
    const Classification figures = classification(counts[i], readings.zero_division);
    row[fmt::format("contact_precision_{}", kThresholdNames[i])] = figures.precision;
    row[fmt::format("contact_recall_{}", kThresholdNames[i])] = figures.recall;
    row[fmt::format("contact_f1_{}", kThresholdNames[i])] = figures.f1;
    row[fmt::format("contact_accuracy_{}", kThresholdNames[i])] = figures.accuracy;
    if (object)
      row[fmt::format("object_contact_f1_{}", kThresholdNames[i])] =
          classification(object_counts[i], readings.zero_division).f1;
  }
  row["clips"] = static_cast<double>(scores.size());
  return row;
}

std::vector<std::string> columns_of(const std::map<std::string, std::map<std::string, double>>& summary) {
  std::vector<std::string> columns;
  for (const Task task : all_tasks())
    if (summary.contains(std::string(to_string(task)))) columns.emplace_back(to_string(task));
  if (columns.size() > 1) columns.emplace_back("all");
  return columns;
}

// Clips of one task may have objects and those of another none.
double value_of(const std::map<std::string, double>& row, const std::string& name) {
  const auto found = row.find(name);
  return found == row.end() ? std::nan("") : found->second;
}

std::string cell(double value, bool percent) {
  if (!std::isfinite(value)) return "-";
  return percent ? fmt::format("{:.0f} %", 100.0 * value) : fmt::format("{:.4g}", value);
}

// Two figures whose other reading people quote as often: printed beside the default ones.
void add_other_readings(const PairedMotion& motion, const RobotModel& robot, std::map<std::string, double>& metrics) {
  metrics["jpe.pelvis"] = motion.reshaped.empty()
                              ? std::nan("")
                              : jpe(pair_tracks(motion.robot, robot), motion.reshaped, JpeFrame::kPelvis);
  metrics["large_angle_ratio.entry"] = large_angle_ratio(hinge_magnitudes(motion.robot.q), LargeAngle::kEntry);
}

std::vector<DetectorView> views_of(const PairedMotion& motion, const std::shared_ptr<const RobotModel>& robot) {
  const Recording played = play_back(motion.robot, motion.partner.joints, motion.task, motion.phases, robot);
  std::vector<DetectorView> views = robot_views(played, *robot);
  views.insert(views.begin(), DetectorView{"people", human_agent(motion.source_partner.joints),
                                           human_agent(motion.source_reactor.joints), DetectorVersion::kRobot});
  return views;
}

}  // namespace

ClipScore score_clip(const PairedMotion& motion, const std::shared_ptr<const RobotModel>& robot,
                     const ScoreOptions& options) {
  constexpr double kBytesOfFrame = 10.0e3;  // measured with a motion of 4 minutes
  require_memory(fmt::format("clip '{}': {} frames", motion.clip_id, motion.frames()), motion.frames() * kBytesOfFrame);
  const Readings& readings = options.readings;
  ClipScore score;
  score.clip = motion.clip_id;
  score.task = to_string(motion.task);
  score.metrics = retargeting_metrics(motion, *robot, readings.metrics);
  add_other_readings(motion, *robot, score.metrics);
  score.metrics.merge(grounding_metrics(motion, *robot));
  score.metrics.merge(object_metrics(motion, *robot, readings.metrics.zero_division));
  score.object_contacts = object_contact_counts(motion, *robot);
  if (options.all_readings) score.all_readings = retargeting_metrics_all_readings(motion, *robot, readings.metrics);
  score.contacts = retargeting_contact_counts(motion, *robot, readings.metrics);
  const std::vector<DetectorView> views = views_of(motion, robot);
  for (const DetectorScore& found : score_detectors({motion.task}, views, options.thresholds, readings.detectors)) {
    if (found.view == "people") score.source_detected = found.result.success;
    if (found.view == "robot") score.robot_detected = found.result.success;
    if (found.view == "printed") score.paper_detected = found.result.success;
  }
  if (options.all_detectors)
    score.detectors =
        score_detectors({all_tasks().begin(), all_tasks().end()}, views, options.thresholds, readings.detectors);
  return score;
}

std::map<std::string, std::map<std::string, double>> summarize_scores(const std::vector<ClipScore>& scores,
                                                                      const MetricReadings& readings) {
  std::map<std::string, std::vector<const ClipScore*>> groups;
  for (const ClipScore& score : scores) {
    groups[score.task].push_back(&score);
    groups["all"].push_back(&score);
  }
  std::map<std::string, std::map<std::string, double>> summary;
  for (const auto& [group, members] : groups) summary[group] = summarize(members, readings);
  return summary;
}

std::string score_table(const std::map<std::string, std::map<std::string, double>>& summary) {
  const std::vector<std::string> columns = columns_of(summary);
  std::string text = fmt::format("{:<26} {:<8}", "metric", "unit");
  for (const std::string& column : columns) text += fmt::format(" {:>10}", column);
  text += "\n";
  const auto add_row = [&](const std::string& title, std::string_view unit, const std::string& name, bool percent) {
    text += fmt::format("{:<26} {:<8}", title, unit);
    for (const std::string& column : columns)
      text += fmt::format(" {:>10}", cell(value_of(summary.at(column), name), percent));
    text += "\n";
  };
  add_row("clips", "", "clips", false);
  for (const MetricInfo& metric : metric_catalogue()) {
    const std::string name(metric.name);
    const bool of_a_motion = metric.group == MetricGroup::kRetargeting || metric.group == MetricGroup::kOtherReading ||
                             metric.group == MetricGroup::kGrounding || metric.group == MetricGroup::kObject;
    const auto has = [&](const std::string& column) { return summary.at(column).contains(name); };
    if (of_a_motion && std::ranges::any_of(columns, has)) add_row(name, metric.unit, name, false);
  }
  for (const auto& [name, title] : detector_rows()) add_row(title, "", name, true);
  return text;
}

std::string readings_table(const std::vector<ClipScore>& scores) {
  TextTable table{.header = {"figure", "unit", "mean over clips", "clips"}, .rows = {}, .label_columns = 2};
  std::map<std::string, std::pair<double, int>> sums;
  for (const ClipScore& score : scores)
    for (const auto& [name, value] : score.all_readings) {
      auto& [sum, count] = sums[name];
      if (!std::isfinite(value)) continue;
      sum += value;
      ++count;
    }
  for (const auto& [name, entry] : sums) {
    const auto& [sum, count] = entry;
    table.rows.push_back({name, std::string(metric_of_reading(name).unit),
                          count > 0 ? fmt::format("{:.4g}", sum / count) : "-", std::to_string(count)});
  }
  return table.rows.empty() ? "" : markdown_table(table);
}

nlohmann::json score_json(const std::vector<ClipScore>& scores,
                          const std::map<std::string, std::map<std::string, double>>& summary) {
  nlohmann::json json = {{"clips", nlohmann::json::array()}, {"summary", nlohmann::json::object()}};
  for (const ClipScore& score : scores) {
    json["clips"].push_back({{"clip", score.clip},
                             {"task", score.task},
                             {"metrics", numbers_or_null(score.metrics)},
                             {"source_detected", score.source_detected},
                             {"robot_detected", score.robot_detected},
                             {"paper_detected", score.paper_detected}});
    if (!score.all_readings.empty()) json["clips"].back()["all_readings"] = numbers_or_null(score.all_readings);
    if (!score.detectors.empty()) json["clips"].back()["detectors"] = detectors_json(score.detectors);
  }
  for (const auto& [group, values] : summary) json["summary"][group] = numbers_or_null(values);
  return json;
}

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
