#include "duet/scoring/recording_scores.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "duet/core/require.h"
#include "duet/metrics/catalogue.h"
#include "duet/metrics/diagnostics.h"
#include "duet/metrics/interaction.h"
#include "duet/report/tables/text_table.h"
#include "duet/robots/robot_cards.h"
#include "duet/scoring/scoring.h"

namespace duet {
namespace {

std::shared_ptr<const RobotModel> robot_of(const EpisodeRecording& episode) {
  if (!episode.kept) return load_shared_robot();
  const std::string& digest = episode.kept->row.robot_digest;
  if (auto robot = robot_of_digest(digest)) return robot;
  throw InputError(fmt::format(
      "it was run on a robot that does not ship with duet (digest {:.8}); give its card with --card", digest));
}

void check_joints(const Recording& recording, const RobotModel& robot) {
  if (recording.frames() == 0) throw InputError("expected a recording with frames, found none");
  const auto joints = recording.robot.front().q.size();
  if (joints != robot.dof())
    throw InputError(fmt::format("expected the {} joints of '{}', found {}; give the robot's card with --card",
                                 robot.dof(), robot.name, joints));
}

RobotMotion motion_of(const Recording& recording, const RobotModel& robot) {
  RobotMotion motion{.rate_hz = recording.rate_hz, .joint_names = robot.joint_names(), .root = {}, .q = {}};
  motion.q.resize(robot.dof(), recording.frames());
  for (int t = 0; t < recording.frames(); ++t) {
    motion.root.push_back(recording.robot[t].X_WB);
    motion.q.col(t) = recording.robot[t].q;
  }
  return motion;
}

// A motion that was played back is its own reference: errors against it are 0 and say nothing.
bool is_own_reference(const Recording& recording) {
  for (int t = 0; t < recording.frames(); ++t)
    if (recording.robot[t].q != recording.reference[t].q || recording.robot[t].X_WB.p != recording.reference[t].X_WB.p)
      return false;
  return true;
}

// The metrics of a recording that no run kept.
std::map<std::string, double> metrics_of(const Recording& recording, const RobotModel& robot,
                                         const Readings& readings) {
  std::map<std::string, double> metrics;
  if (!recording.partner.empty()) add_finite(onsets(recording, robot), metrics);
  if (recording.frames() < kShortestScored) return metrics;
  add_finite(controller_diagnostics(recording, readings.diagnostics), metrics);
  add_finite(root_error_parts(recording), metrics);
  if (is_own_reference(recording))
    std::erase_if(metrics, [](const auto& entry) {
      return entry.first.find("_error") != std::string::npos || entry.first.ends_with("_reference");
    });
  add_finite(motion_metrics(motion_of(recording, robot), robot, readings.metrics), metrics);
  return metrics;
}

void score_kept(const EpisodeRecording& episode, const RobotModel& robot, RecordingScore& score) {
  score.row = score_again(episode.recording, *episode.kept, robot);
  score.metrics = score.row->metrics.map();
  if (episode.recording.frames() >= kShortestScored) add_finite(root_error_parts(episode.recording), score.metrics);
  score.differences = row_differences(episode.kept->row, *score.row);
}

void add_detectors(const RobotModel& robot, const ScoreOptions& options, RecordingScore& score) {
  const std::vector<DetectorView> views = robot_views(score.recording, robot);
  std::vector<Task> tasks;
  if (options.all_detectors)
    tasks.assign(all_tasks().begin(), all_tasks().end());
  else if (score.recording.task)
    tasks = {*score.recording.task};
  score.detectors = score_detectors(tasks, views, options.thresholds, options.readings.detectors);
}

std::string task_name(const Recording& recording) {
  return recording.task ? std::string(to_string(*recording.task)) : "no task";
}

// The verdict of the detector of the recording's own task.
std::string verdict(const RecordingScore& score, const std::string& view) {
  for (const DetectorScore& found : score.detectors)
    if (found.task == score.recording.task && found.view == view) return found.result.success ? "yes" : "no";
  return "-";
}

std::string identity(const RecordingScore& score) {
  const Recording& recording = score.recording;
  std::string text = fmt::format("{}: recording of {} frames, {:.2f} s, outcome {}", score.file, recording.frames(),
                                 recording.frames() / recording.rate_hz, to_string(recording.outcome));
  if (!recording.message.empty()) text += fmt::format(" ({})", recording.message);
  if (recording.partner.empty()) return text + "; no partner, so no detector and no figure of a pair\n";
  text += fmt::format("; {} with a partner\n", task_name(recording));
  if (!score.row) return text;
  const EpisodeRow& row = *score.row;
  return text + fmt::format("episode {} of clip '{}' of {} {}: {}/{}/{}, {}, {} arm; success: {}\n", row.episode,
                            row.clip, row.suite, row.suite_version, row.engine, row.controller, row.policy,
                            row.perturbation, row.arm, row.success.value_or(false) ? "yes" : "no");
}

std::string metrics_text(const std::map<std::string, double>& metrics) {
  std::string text;
  for (const MetricInfo& info : metric_catalogue())
    if (const auto found = metrics.find(std::string(info.name)); found != metrics.end())
      text += fmt::format("{:<26} {:<8} {:>10.4g}\n", info.name, info.unit, found->second);
  return text;
}

std::string repeat_text(const RecordingScore& score) {
  if (!score.row) return "";
  if (score.differences.empty()) return "the row is the one that the run wrote, bit for bit\n";
  return fmt::format("the row is NOT the one that the run wrote: {}\n", differences_text(score.differences));
}

std::string cell(const RecordingScore& score, const char* metric) {
  const auto found = score.metrics.find(metric);
  return found == score.metrics.end() ? "-" : fmt::format("{:.4g}", found->second);
}

}  // namespace

RecordingScore score_recording_file(const std::string& file, const Npz& npz, std::shared_ptr<const RobotModel> robot,
                                    const ScoreOptions& options) {
  EpisodeRecording episode = read_episode_recording(npz);
  RecordingScore score;
  score.file = file;
  try {
    if (robot == nullptr) robot = robot_of(episode);
    check_joints(episode.recording, *robot);
    if (const auto mask = read_executed_mask(npz)) score.executed = executed_mask_text(*mask, *robot);
    if (episode.kept) score_kept(episode, *robot, score);
    score.recording = std::move(episode.recording);
    if (!episode.kept) score.metrics = metrics_of(score.recording, *robot, options.readings);
    if (score.recording.outcome == Outcome::kFell)
      score.metrics["time_to_fall"] = score.recording.frames() / score.recording.rate_hz;
    add_detectors(*robot, options, score);
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("'{}': {}", file, error.what()));
  } catch (const InputError& error) {
    throw InputError(fmt::format("'{}': {}", file, error.what()));
  }
  return score;
}

std::string recording_text(const RecordingScore& score) {
  std::string text = identity(score);
  if (!score.executed.empty()) text += fmt::format("executed of the reference: {}\n", score.executed);
  text += metrics_text(score.metrics) + repeat_text(score);
  if (!score.detectors.empty()) text += "\n" + detectors_table(score.detectors);
  return text;
}

std::string recordings_table(const std::vector<RecordingScore>& scores) {
  TextTable table{.header = {"recording", "task", "outcome", "robot", "printed", "hf_ratio", "dof_jerk", "root_jerk",
                             "root_error", "horizontal", "vertical", "dof_error", "as in the run"},
                  .rows = {},
                  .label_columns = 3};
  for (const RecordingScore& score : scores) {
    const bool alone = score.recording.partner.empty();
    table.rows.push_back({score.file, alone ? "-" : task_name(score.recording),
                          std::string(to_string(score.recording.outcome)), verdict(score, "robot"),
                          verdict(score, "printed"), cell(score, "hf_ratio"), cell(score, "dof_jerk"),
                          cell(score, "root_jerk"), cell(score, "root_error"), cell(score, "root_error.horizontal"),
                          cell(score, "root_error.vertical"), cell(score, "dof_error"),
                          !score.row                  ? "-"
                          : score.differences.empty() ? "yes"
                                                      : "NO"});
  }
  return markdown_table(table);
}

nlohmann::json recordings_json(const std::vector<RecordingScore>& scores) {
  nlohmann::json json = nlohmann::json::array();
  for (const RecordingScore& score : scores) {
    const bool partner = !score.recording.partner.empty();
    nlohmann::json entry = {
        {"file", score.file},
        {"task", partner && score.recording.task ? nlohmann::json(task_name(score.recording)) : nlohmann::json()},
        {"partner", partner},
        {"outcome", to_string(score.recording.outcome)},
        {"frames", score.recording.frames()},
        {"seconds", score.recording.frames() / score.recording.rate_hz},
        {"metrics", score.metrics}};
    if (!score.detectors.empty()) entry["detectors"] = detectors_json(score.detectors);
    if (score.row) {
      entry["row"] = to_json(*score.row);
      entry["as_in_the_run"] = score.differences.empty();
      entry["differences"] = nlohmann::json::array();
      for (const FieldDifference& difference : score.differences) entry["differences"].push_back(difference.field);
    }
    json.push_back(std::move(entry));
  }
  return json;
}

namespace {

constexpr std::size_t kRootChannelCount = 7;

}  // namespace

ExecutedMask executed_mask(const RobotModel& robot, const std::vector<int>& joints, bool height) {
  ExecutedMask mask(kRootChannelCount + robot.joints.size(), false);
  mask[0] = mask[1] = mask[3] = mask[6] = true;
  mask[2] = height;
  for (const int joint : joints) mask[kRootChannelCount + static_cast<std::size_t>(joint)] = true;
  return mask;
}

std::string executed_mask_text(const ExecutedMask& mask, const RobotModel& robot) {
  require(mask.size() == kRootChannelCount + robot.joints.size(), "executed channels: expected {} for '{}', found {}",
          kRootChannelCount + robot.joints.size(), robot.name, mask.size());
  std::vector<std::string> left_out;
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    if (!mask.at(kRootChannelCount + j)) left_out.push_back(robot.joints[j].name);
  return fmt::format("root {}; {} of {} joints, not {}", mask[2] ? "velocity and height" : "velocity",
                     robot.joints.size() - left_out.size(), robot.joints.size(),
                     left_out.empty() ? "any" : fmt::format("{}", fmt::join(left_out, ", ")));
}

void put_executed_mask(const ExecutedMask& mask, Npz& npz) {
  npz.set("executed", std::vector<std::int64_t>(mask.begin(), mask.end()), {mask.size()});
}

std::optional<ExecutedMask> read_executed_mask(const Npz& npz) {
  if (!npz.contains("executed")) return {};
  const std::vector<std::int64_t> values = npz.integers("executed", {-1});
  if (values.size() <= kRootChannelCount)
    throw InputError(fmt::format("'{}': array 'executed': expected more than {} channels, found {}", npz.name(),
                                 kRootChannelCount, values.size()));
  for (const std::int64_t value : values)
    if (value != 0 && value != 1)
      throw InputError(fmt::format("'{}': array 'executed': expected 0 or 1, found {}", npz.name(), value));
  return ExecutedMask(values.begin(), values.end());
}

}  // namespace duet
