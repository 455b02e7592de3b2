#include "duet/execution/report_content.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/execution/run_inputs.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/experiment/plan/shipped_suites.h"
#include "duet/experiment/work/run_work.h"
#include "duet/metrics/catalogue.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/yaml_section.h"
#include "duet/scoring/scoring.h"

namespace duet {
namespace {

constexpr const char* kNullAndLift =
    "Null: the same episodes with a robot that holds its neutral pose. Lift is success minus the null arm's on the "
    "same "
    "episodes.";

StickFigure human_figure(const std::string& label, const HumanMotion& motion, int frame) {
  StickFigure figure{label, {}, {}};
  for (int j = 0; j < kSmplJoints; ++j) {
    figure.points.emplace_back(motion.joints.at(frame, j));
    if (kSmplParents[j] >= 0) figure.bones.emplace_back(kSmplParents[j], j);
  }
  return figure;
}

// Links as a tree, and the virtual frames (head, hands, toes) that the card hangs on them.
StickFigure robot_figure(const RobotModel& robot, const RobotMotion& motion, int frame) {
  Kinematics kinematics(robot);
  kinematics.update(motion.root[frame], motion.q.col(frame));
  StickFigure figure{"robot", {}, {}};
  for (size_t i = 0; i < robot.links.size(); ++i) {
    figure.points.push_back(kinematics.p_WL(static_cast<int>(i)));
    if (robot.links[i].parent >= 0) figure.bones.emplace_back(robot.links[i].parent, static_cast<int>(i));
  }
  for (const RetargetPair& pair : robot.pairs) {
    figure.bones.emplace_back(robot.frames[pair.frame].link, static_cast<int>(figure.points.size()));
    figure.points.push_back(kinematics.frame_position(pair.frame));
  }
  return figure;
}

KeyFrame key_frame(const std::string& label, const PairedMotion& motion, const RobotModel& robot, int frame) {
  return {fmt::format("{} ({:.1f} s)", label, frame / motion.robot.rate_hz),
          {human_figure("source", motion.source_reactor, frame), human_figure("human", motion.partner, frame),
           robot_figure(robot, motion.robot, frame)}};
}

MetricColumn column_of(const MetricInfo& metric) {
  const char* direction = metric.direction == Direction::kLower    ? "lower"
                          : metric.direction == Direction::kHigher ? "higher"
                                                                   : "";
  return {std::string(metric.name), std::string(metric.title), std::string(metric.unit), direction};
}

std::vector<MetricColumn> metric_columns() {
  std::vector<MetricColumn> columns;
  for (const MetricInfo& metric : metric_catalogue()) columns.push_back(column_of(metric));
  columns.insert(columns.end(), {{"source_detected", "Task detected, people", "1", "higher"},
                                 {"robot_detected", "Task detected, robot", "1", "higher"},
                                 {"paper_detected", "Task detected, as printed", "1", "higher"},
                                 {"clips", "Clips", "", ""}});
  return columns;
}

std::vector<std::string> notes_of(const Suite& suite) {
  std::vector<std::string> notes = {
      fmt::format(
          "Suite {} {}: start \"{}\", partner \"{}\", engine profile \"{}\", headline detector version \"{}\" with "
          "\"{}\" thresholds.",
          suite.name, suite.version, to_string(suite.start), to_string(suite.partner), suite.profile.name,
          to_string(suite.detector), to_string(suite.thresholds)),
      "Start \"auto\" means: a controller that cannot walk starts at the act position; one that walks approaches.",
      "Each controller runs on the body that it was made for; joints that the clips lack stay at neutral.",
      kNullAndLift,
      "Episodes that fell, diverged, timed out or failed with an error count as failures.",
  };
  if (suite.partner == SuitePartner::kGhost)
    notes.emplace_back("A ghost partner touches nothing: the robot passes through it.");
  if (suite.partner == SuitePartner::kYielding)
    notes.emplace_back(
        "A yielding partner gives way where the robot touches them, as a passive body does: they do not step, and they "
        "intend nothing but the clip.");
  if (std::ranges::find(suite.engines, kPlaybackEngine) != suite.engines.end())
    notes.emplace_back(
        "Playback moves the robot along its reference without physics. It is no upper bound for policies that look at "
        "the robot.");
  return notes;
}

}  // namespace

ClipStory clip_story(const PairedMotion& motion, const ClipScore& score, const RobotModel& robot) {
  ClipStory story;
  story.title = motion.clip_id;
  story.task = to_string(motion.task);
  const int middle = (motion.phases.act_begin + motion.phases.act_end) / 2;
  story.frames = {key_frame("start", motion, robot, 0), key_frame("act", motion, robot, middle),
                  key_frame("end", motion, robot, motion.frames() - 1)};
  story.loss = motion.loss;
  story.metrics = score.metrics;
  return story;
}

namespace {

// The policy that each name in the suite's text uses; empty for a text that is no suite.
std::map<std::string, std::string> used_policies(const std::string& suite_yaml) {
  std::map<std::string, std::string> uses;
  try {
    for (const YAML::Node& node : parse_yaml(suite_yaml, "suite.yaml")["policies"]) {
      const YAML::Node name = node.IsMap() ? node["name"] : node;
      if (!name.IsDefined() || !name.IsScalar()) continue;
      const bool says = node.IsMap() && node["use"].IsDefined() && node["use"].IsScalar();
      uses[name.Scalar()] = says ? node["use"].Scalar() : name.Scalar();
    }
  } catch (const std::exception&) {  // what this program does not read names no policy of its own
    return {};
  }
  return uses;
}

}  // namespace

PolicyRoles roles_of(const RunInfo& info) {
  const std::map<std::string, std::string> uses = used_policies(info.suite_yaml);
  PolicyRoles roles;
  for (const std::string& shipped : policy_names()) {
    const PolicyRole role = policy_role(shipped);
    if (role.role == ArmRole::kCompetitor) continue;
    const std::string digest = identity_of(SuitePolicy{.name = shipped}).digest;
    for (const auto& [name, own] : info.policies) {
      const auto use = uses.find(name);
      if (use != uses.end() ? use->second == shipped : own == digest) roles[name] = role;
    }
  }
  return roles;
}

RankingSuite board_suite(const RunInfo& info) {
  const std::string name = fmt::format("{} {}", info.suite, info.suite_version);
  const std::string note = shipped_suite_note(info);
  RankingSuite suite{.label = note.empty() ? suite_label(info) : fmt::format("{}, {}", name, note),
                     .roles = roles_of(info)};
  if (note.starts_with("NOT")) suite.warning = fmt::format("{} is {}.", name, note);
  return suite;
}

RunTables tables_of(std::vector<EpisodeRow> rows, const Run& run) {
  RunMetrics metrics;
  for (const MetricInfo& metric : metric_catalogue()) {
    metrics.all.push_back(column_of(metric));
    if (metric.group == MetricGroup::kRetargeting) metrics.drifting.push_back(column_of(metric));
  }
  return run_tables(std::move(rows), std::move(metrics), run.info.certificate, run.file, board_suite(run.info));
}

std::vector<TrainingCurves> training_curves(const std::vector<std::string>& files) {
  std::vector<TrainingCurves> curves;
  curves.reserve(files.size());
  for (const std::string& file : files) curves.push_back(load_curves(file));
  return curves;
}

ReportContent report_content(const Run& run, const RunTables& tables, std::vector<Analysis> analyses,
                             std::vector<ReportReplay> replays, bool with_clips,
                             const std::vector<std::string>& curve_files, int threads, Progress& progress) {
  ReportContent content;
  const Suite suite = suite_of_head(run);
  content.curves = training_curves(curve_files);
  content.title = tables.board.suite.label;
  content.environment = run.info.environment;
  content.notes = notes_of(suite);
  content.analyses = std::move(analyses);
  content.columns = metric_columns();
  content.episodes = listed_episodes(tables.rows, replays);
  content.all_episodes = tables.rows.size();
  content.replays = std::move(replays);
  if (!with_clips || !suite.references.empty()) return content;
  if (const std::string fault = clips_fault(run, suite.clips.files); !fault.empty()) {
    content.notes.push_back(fmt::format("Key frames and loss curves of the clips are left out: {}.", fault));
    return content;
  }

  const auto robot = load_shared_robot(suite.robot);
  const std::vector<PairedMotion> clips = prepare_clips(suite, *robot, threads, progress);
  const Readings readings = suite.metric_readings();
  std::vector<ClipScore> scores(clips.size());
  content.stories.resize(std::min(clips.size(), kMostStories));
  if (clips.size() > kMostStories)
    content.notes.push_back(
        fmt::format("Key frames and loss curves are those of the first {} of {} clips.", kMostStories, clips.size()));
  progress.start("drawing", static_cast<int>(clips.size()), "clips");
  parallel_for_each(static_cast<int>(clips.size()), threads, [&](int i) {
    scores[i] = score_clip(clips[i], robot, {.readings = readings});
    if (std::cmp_less(i, content.stories.size())) content.stories[i] = clip_story(clips[i], scores[i], *robot);
    progress.advance();
  });
  progress.finish();
  content.retargeting = summarize_scores(scores, readings.metrics);
  return content;
}

}  // namespace duet
