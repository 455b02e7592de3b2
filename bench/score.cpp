#include "bench/score.h"

#include <fmt/format.h>

#include <cmath>

#include "bench/rollout.h"
#include "metrics/catalogue.h"
#include "metrics/detector.h"
#include "robots/kinematics.h"

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

nlohmann::json finite_or_null(const std::map<std::string, double>& values) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [name, value] : values) json[name] = std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
  return json;
}

// Mean over the clips that have a value.
double mean_of(const std::vector<const ClipScore*>& scores, const std::string& metric) {
  double sum = 0.0;
  int count = 0;
  for (const ClipScore* score : scores) {
    const double value = score->metrics.at(metric);
    if (!std::isfinite(value)) continue;
    sum += value;
    ++count;
  }
  return count > 0 ? sum / count : std::nan("");
}

std::map<std::string, double> summarize(const std::vector<const ClipScore*>& scores, const MetricReadings& readings) {
  std::map<std::string, double> row;
  std::array<ContactCounts, 3> counts{};
  for (const ClipScore* score : scores) {
    for (size_t i = 0; i < counts.size(); ++i) counts[i] += score->contacts[i];
    row["source_detected"] += score->source_detected;
    row["robot_detected"] += score->robot_detected;
    row["paper_detected"] += score->paper_detected;
  }
  for (const auto& [name, title] : detector_rows()) row[name] /= static_cast<double>(scores.size());
  for (const auto& [name, value] : scores.front()->metrics) row[name] = mean_of(scores, name);
  for (size_t i = 0; i < counts.size(); ++i) {
    const Classification figures = classification(counts[i], readings.zero_division);
    row[fmt::format("contact_precision_{}", kThresholdNames[i])] = figures.precision;
    row[fmt::format("contact_recall_{}", kThresholdNames[i])] = figures.recall;
    row[fmt::format("contact_f1_{}", kThresholdNames[i])] = figures.f1;
    row[fmt::format("contact_accuracy_{}", kThresholdNames[i])] = figures.accuracy;
  }
  row["clips"] = static_cast<double>(scores.size());
  return row;
}

std::vector<std::string> columns_of(const std::map<std::string, std::map<std::string, double>>& summary) {
  std::vector<std::string> columns;
  for (const Task task : kTasks)
    if (summary.contains(std::string(to_string(task)))) columns.emplace_back(to_string(task));
  if (columns.size() > 1) columns.emplace_back("all");
  return columns;
}

std::string cell(double value, bool percent) {
  if (!std::isfinite(value)) return "-";
  return percent ? fmt::format("{:.0f} %", 100.0 * value) : fmt::format("{:.4g}", value);
}

}  // namespace

ClipScore score_clip(const PairedMotion& motion, const std::shared_ptr<const RobotModel>& robot,
                     const Readings& readings) {
  ClipScore score;
  score.clip = motion.clip_id;
  score.task = to_string(motion.task);
  score.metrics = retargeting_metrics(motion, *robot, readings.metrics);
  // Two figures whose other reading people quote as often: printed beside the default ones.
  const PointTracks pairs = pair_tracks(motion.robot, *robot);
  score.metrics["jpe.pelvis"] = jpe(pairs, motion.reshaped, JpeFrame::kPelvis);
  score.metrics["large_angle_ratio.entry"] = large_angle_ratio(hinge_magnitudes(motion.robot.q), LargeAngle::kEntry);
  score.contacts = retargeting_contact_counts(motion, *robot, readings.metrics);
  const Recording played = play_back(motion.robot, motion.partner.joints, motion.task, motion.phases, robot);
  const Agent human = human_agent(played.partner);
  const Agent machine = robot_agent(*robot, played.robot);
  const auto accepted = [&](const Agent& partner, const Agent& performer, DetectorVersion version) {
    return detect(motion.task, partner, performer, version, ThresholdSet::kPaper, readings.detectors).success;
  };
  score.source_detected = accepted(human_agent(motion.source_partner.joints), human_agent(motion.source_reactor.joints),
                                   DetectorVersion::kRobot);
  score.robot_detected = accepted(human, machine, DetectorVersion::kRobot);
  score.paper_detected = accepted(human, machine, DetectorVersion::kPaper);
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
      text += fmt::format(" {:>10}", cell(summary.at(column).at(name), percent));
    text += "\n";
  };
  add_row("clips", "", "clips", false);
  for (const MetricInfo& metric : metric_catalogue()) {
    const std::string name(metric.name);
    if (metric.group == MetricGroup::kRetargeting && summary.at(columns.front()).contains(name))
      add_row(name, metric.unit, name, false);
  }
  add_row("jpe, pelvis-aligned", "m", "jpe.pelvis", false);
  add_row("large angles, per joint", "1", "large_angle_ratio.entry", false);
  for (const auto& [name, title] : detector_rows()) add_row(title, "", name, true);
  return text;
}

nlohmann::json score_json(const std::vector<ClipScore>& scores,
                          const std::map<std::string, std::map<std::string, double>>& summary) {
  nlohmann::json json = {{"clips", nlohmann::json::array()}, {"summary", nlohmann::json::object()}};
  for (const ClipScore& score : scores) {
    json["clips"].push_back({{"clip", score.clip},
                             {"task", score.task},
                             {"metrics", finite_or_null(score.metrics)},
                             {"source_detected", score.source_detected},
                             {"robot_detected", score.robot_detected},
                             {"paper_detected", score.paper_detected}});
  }
  for (const auto& [group, values] : summary) json["summary"][group] = finite_or_null(values);
  return json;
}

}  // namespace duet
