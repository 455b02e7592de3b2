#include "duet/metrics/detector.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "duet/core/names.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/metrics/readings.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/roles.h"
#include "duet/tasks/rules/evidence.h"

namespace duet {
namespace {

void check_tracks(Task task, const Tracks& tracks) {
  const Eigen::Index frames = tracks.front().track->cols();
  for (const auto& [name, track] : tracks) {
    require(track->cols() > 0, "{} detector: the track {} is needed and empty", to_string(task), name);
    require(track->cols() == frames, "{} detector: the track {} has {} frames, but {} has {}", to_string(task), name,
            track->cols(), tracks.front().name, frames);
    if (track->allFinite()) continue;
    for (Eigen::Index t = 0; t < frames; ++t)
      require(track->col(t).allFinite(), "{} detector: the track {} is not finite at frame {}", to_string(task), name,
              t);
  }
}

// The task's thresholds with those given in the place of the set's.
Thresholds completed(Task task, const Thresholds& given, ThresholdSet set = ThresholdSet::kPaper) {
  Thresholds complete = thresholds(task, set);
  for (const auto& [name, value] : given) {
    const auto known = complete.find(name);
    if (known == complete.end()) {
      std::vector<std::string> names;
      for (const auto& entry : complete) names.push_back(entry.first);
      throw std::invalid_argument(unknown_name_message(fmt::format("threshold of {}", to_string(task)), name, names));
    }
    require(std::isfinite(value), "threshold {} of {} is not finite", name, to_string(task));
    known->second = value;
  }
  return complete;
}

const ActRule& rule_of(Task task) {
  const ActRule* rule = definition_of(task).rule;
  require(rule != nullptr, "{} detector: the set act has no rule of its own for it", to_string(task));
  return *rule;
}

}  // namespace

std::string_view to_string(DetectorVersion version) {
  if (version == DetectorVersion::kInteraction) return "interaction";
  return version == DetectorVersion::kPaper ? "paper" : "robot";
}
std::string_view to_string(ThresholdSet set) {
  return set == ThresholdSet::kPaper ? "paper" : set == ThresholdSet::kStrict ? "strict" : "act";
}

ThresholdSet parse_threshold_set(std::string_view name) {
  std::vector<std::string> known;
  for (const ThresholdSet set : kThresholdSets) {
    if (name == to_string(set)) return set;
    known.emplace_back(to_string(set));
  }
  throw std::invalid_argument(unknown_name_message("set of thresholds", name, known));
}

Thresholds thresholds(Task task, ThresholdSet set) {
  Thresholds tau;
  if (const ActRule* rule = definition_of(task).rule; set == ThresholdSet::kAct && rule != nullptr) {
    for (const RuleThreshold& threshold : rule->thresholds) tau[std::string(threshold.name)] = threshold.value;
    return tau;
  }
  for (const ThresholdInfo& info : definition_of(task).detector.thresholds)
    tau[std::string(info.name)] = set == ThresholdSet::kPaper ? info.paper : info.strict;
  return tau;
}

DetectorResult detect_performer(Task task, const Agent& performer, const Agent& partner, const Thresholds& thresholds,
                                const DetectorReadings& readings) {
  const TaskDetector& detector = definition_of(task).detector;
  check_tracks(task, detector.tracks(performer, partner, readings));
  return detector.detect(performer, partner, completed(task, thresholds), readings);
}

DetectorResult detect_by_rule(Task task, const Agent& performer, const Agent& partner, const Thresholds& thresholds) {
  const ActRule& rule = rule_of(task);
  check_tracks(task, rule.tracks(performer, partner));
  const Thresholds tau = completed(task, thresholds, ThresholdSet::kAct);
  return rule.detect(rules::smoothed(performer), rules::smoothed(partner), tau);
}

SmoothedAgents smoothed_for_rules(const Agent& performer, const Agent& partner) {
  for (const Task task : all_tasks())
    if (const ActRule* rule = definition_of(task).rule) check_tracks(task, rule->tracks(performer, partner));
  return {rules::smoothed(performer), rules::smoothed(partner)};
}

DetectorResult detect_by_rule(Task task, const SmoothedAgents& agents) {
  return rule_of(task).detect(agents.performer, agents.partner, thresholds(task, ThresholdSet::kAct));
}

DetectorResult detect(Task task, const Agent& human, const Agent& robot, DetectorVersion version, ThresholdSet set,
                      DetectorReadings readings) {
  require(version != DetectorVersion::kInteraction,
          "detector: the rule `interaction` judges an episode, not two agents (metrics/interaction.h)");
  if (set != ThresholdSet::kPaper) readings = strict_readings(readings);
  const bool paper = version == DetectorVersion::kPaper;
  const Agent& performer = paper ? human : robot;
  const Agent& partner = paper ? robot : human;
  if (set == ThresholdSet::kAct && definition_of(task).rule != nullptr)
    return detect_by_rule(task, performer, partner, {});
  return detect_performer(task, performer, partner, thresholds(task, set), readings);
}

// The detectors' tracks of a human and of a robot.

namespace {

struct Follower {
  int frame;
  Eigen::Matrix3Xd* track;
};

Agent empty_agent(Eigen::Index frames) {
  Agent agent;
  for (Eigen::Matrix3Xd* track :
       {&agent.lhand, &agent.rhand, &agent.head, &agent.root, &agent.torso, &agent.lshoulder, &agent.rshoulder})
    track->resize(3, frames);
  return agent;
}

// Median over the frames of the mean of both arms. [m]
double arm_of(const PointTracks& smpl24) {
  std::vector<double> arms;
  for (int t = 0; t < smpl24.frames(); ++t) {
    const PointTracks::ConstFrame joints = smpl24.frame(t);
    double both = 0.0;
    for (const auto& [from, to] : {std::pair{kLeftShoulder, kLeftElbow},
                                   {kLeftElbow, kLeftWrist},
                                   {kLeftWrist, kLeftHand},
                                   {kRightShoulder, kRightElbow},
                                   {kRightElbow, kRightWrist},
                                   {kRightWrist, kRightHand}})
      both += (joints.col(to) - joints.col(from)).norm();
    arms.push_back(0.5 * both);
  }
  if (arms.empty()) return kAdultArm;
  const auto middle = arms.begin() + static_cast<std::ptrdiff_t>(arms.size() / 2);
  std::nth_element(arms.begin(), middle, arms.end());
  return *middle > 0.0 ? *middle : kAdultArm;
}

// `pose(t)` and `joints(t)` are the base's pose and the joint angles at frame t.
template <typename PoseAt, typename JointsAt>
Agent follow(const RobotModel& robot, int frames, PoseAt pose, JointsAt joints) {
  Agent agent = empty_agent(frames);
  const Follower followers[] = {
      {robot.track_frame("lhand"), &agent.lhand},         {robot.track_frame("rhand"), &agent.rhand},
      {robot.track_frame("head"), &agent.head},           {robot.track_frame("torso"), &agent.torso},
      {robot.track_frame("lshoulder"), &agent.lshoulder}, {robot.track_frame("rshoulder"), &agent.rshoulder}};
  agent.arm = 0.5 * (arm_length(robot, 0) + arm_length(robot, 1));
  Kinematics kinematics(robot);
  for (int t = 0; t < frames; ++t) {
    if (joints(t).size() != robot.dof())
      throw std::invalid_argument(fmt::format("robot agent: frame {} has {} joint angles, {} has {}", t,
                                              joints(t).size(), robot.name, robot.dof()));
    kinematics.update(pose(t), joints(t));
    agent.root.col(t) = pose(t).p;
    for (const auto& [frame, track] : followers) track->col(t) = kinematics.frame_position(frame);
  }
  return agent;
}

}  // namespace

Agent human_agent(const PointTracks& smpl24) {
  require(smpl24.points() == kSmplJoints, "human agent: expected {} joints, found {}", kSmplJoints, smpl24.points());
  Agent agent = empty_agent(smpl24.frames());
  for (int t = 0; t < smpl24.frames(); ++t) {
    const PointTracks::ConstFrame joints = smpl24.frame(t);
    agent.lhand.col(t) = joints.col(kLeftHand);
    agent.rhand.col(t) = joints.col(kRightHand);
    agent.head.col(t) = joints.col(kHead);
    agent.root.col(t) = joints.col(kPelvis);
    agent.torso.col(t) = joints.col(kSpine3);
    agent.lshoulder.col(t) = joints.col(kLeftShoulder);
    agent.rshoulder.col(t) = joints.col(kRightShoulder);
  }
  agent.arm = arm_of(smpl24);
  return agent;
}

Agent robot_agent(const RobotModel& robot, const std::vector<RobotState>& states) {
  return follow(
      robot, static_cast<int>(states.size()), [&](int t) -> const Pose& { return states[t].X_WB; },
      [&](int t) -> const Eigen::VectorXd& { return states[t].q; });
}

Agent robot_agent(const RobotModel& robot, const RobotMotion& motion) {
  require(motion.joint_names.empty() || motion.joint_names == robot.joint_names(),
          "robot agent: the joints of the motion are not those of {} in its order", robot.name);
  require(motion.q.cols() == motion.frames(), "robot agent: {} root poses, but joint angles of {} frames",
          motion.frames(), motion.q.cols());
  return follow(
      robot, motion.frames(), [&](int t) -> const Pose& { return motion.root[t]; },
      [&](int t) { return motion.q.col(t); });
}

namespace {

template <typename Entry>
const Entry& find_entry(std::span<const Entry> table, const char* kind, Task task, std::string_view name) {
  std::vector<std::string> known;
  for (const Entry& entry : table) {
    if (entry.name == name) return entry;
    known.emplace_back(entry.name);
  }
  throw std::invalid_argument(unknown_name_message(fmt::format("{} of {}", kind, to_string(task)), name, known));
}

bool judged_by_rule(Task task, ThresholdSet set) {
  return set == ThresholdSet::kAct && definition_of(task).rule != nullptr;
}

}  // namespace

std::span<const ThresholdInfo> threshold_catalogue(Task task) { return definition_of(task).detector.thresholds; }
std::span<const DetectorFigure> detector_figures(Task task) { return definition_of(task).detector.figures; }

std::span<const RuleThreshold> rule_thresholds(Task task) {
  const ActRule* rule = definition_of(task).rule;
  return rule != nullptr ? rule->thresholds : std::span<const RuleThreshold>{};
}

std::span<const DetectorFigure> rule_figures(Task task) {
  const ActRule* rule = definition_of(task).rule;
  return rule != nullptr ? rule->figures : std::span<const DetectorFigure>{};
}

const DetectorFigure& detector_figure(Task task, std::string_view name, ThresholdSet set) {
  return find_entry(judged_by_rule(task, set) ? rule_figures(task) : detector_figures(task), "figure", task, name);
}

const ThresholdInfo& threshold_info(Task task, std::string_view name) {
  return find_entry(threshold_catalogue(task), "threshold", task, name);
}

std::string_view threshold_unit(Task task, std::string_view name, ThresholdSet set) {
  if (!judged_by_rule(task, set)) return threshold_info(task, name).unit;
  return find_entry(rule_thresholds(task), "threshold", task, name).unit;
}

std::vector<std::pair<std::string, std::string>> strict_choices(Task task) {
  Readings strict;
  strict.detectors = strict_readings({});
  std::vector<std::pair<std::string, std::string>> choices;
  for (const std::string& option : reading_names())
    if (option.starts_with(std::string(to_string(task)) + ".") && reading(strict, option) != reading({}, option))
      choices.emplace_back(option, reading(strict, option));
  return choices;
}

}  // namespace duet
