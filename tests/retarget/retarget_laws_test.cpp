// Laws of mode `best`: a motion that is cropped, shifted, mirrored or moved in the world gives the same robot, cropped,
// shifted, mirrored or moved; joints keep their speeds; a person who stands upright becomes a robot that does.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "duet/metrics/grounding.h"
#include "duet/motion/people/formats/people_formats.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/retarget/joint_speeds.h"
#include "duet/retarget/pair.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/roles.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kSame = 0.1;  // most that a joint may differ by [rad]

const RobotModel& t1() {
  static const RobotModel model = load_robot(card_path("t1"));
  return model;
}

InteractionClip clip_of_task(Task task) { return synthesize(task, {.seed = 42}); }

InteractionClip cropped(InteractionClip clip, int frames) {
  for (HumanMotion* motion : {&clip.a, &clip.b}) *motion = slice(*motion, frames, motion->frames());
  clip.phases = {std::max(clip.phases.act_begin - frames, 0), std::max(clip.phases.act_end - frames, 0)};
  clip.contacts.clear();
  return clip;
}

InteractionClip moved(InteractionClip clip, double yaw, const Eigen::Vector3d& p) {
  const Eigen::Quaterniond R(yaw_rotation(yaw));
  for (HumanMotion* motion : {&clip.a, &clip.b}) {
    for (int t = 0; t < motion->frames(); ++t) {
      for (int joint = 0; joint < kSmplJoints; ++joint)
        motion->joints.at(t, joint) = (R * Eigen::Vector3d(motion->joints.at(t, joint)) + p).eval();
    }
    for (Eigen::Quaterniond& rotation : motion->rotations) rotation = (R * rotation).normalized();
  }
  return clip;
}

Eigen::MatrixXd joints_of(const InteractionClip& clip, const RobotModel& robot) {
  return retarget(clip, robot, pair_options_of(PairMode::kBest)).robot.q;
}

// The mirror image of a motion's joints, by the names of left and right.
Eigen::MatrixXd mirrored_joints(const RobotModel& robot, const Eigen::MatrixXd& q) {
  const auto counterpart = [](std::string name) {
    for (const auto& [from, to] :
         {std::pair{"left", "right"}, {"right", "left"}, {"Left", "Right"}, {"Right", "Left"}}) {
      const std::size_t at = name.find(from);
      if (at != std::string::npos) return name.replace(at, std::string(from).size(), to);
    }
    return name;
  };
  Eigen::MatrixXd out(q.rows(), q.cols());
  for (int j = 0; j < robot.dof(); ++j) {
    const int other = robot.joint_index(counterpart(robot.joints[static_cast<std::size_t>(j)].name));
    out.row(j) = mirror_sign(robot, other) * q.row(other);
  }
  return out;
}

double farthest(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) { return (a - b).cwiseAbs().maxCoeff(); }

void expect_laws(const InteractionClip& clip, const RobotModel& robot) {
  SCOPED_TRACE(clip.id + " on " + robot.name);
  const Eigen::MatrixXd q = joints_of(clip, robot);
  for (const int frames : {1, 5})
    EXPECT_LT(farthest(q.rightCols(q.cols() - frames), joints_of(cropped(clip, frames), robot)), kSame) << frames;
  const Eigen::MatrixXd later = joints_of(padded(clip, 0.3, 0.0), robot);
  EXPECT_LT(farthest(q, later.rightCols(q.cols())), kSame);
  EXPECT_LT(farthest(q, mirrored_joints(robot, joints_of(mirrored(clip), robot))), kSame);
  EXPECT_LT(farthest(q, joints_of(moved(clip, 2.1, {3.0, -1.5, 0.0}), robot)), kSame);
}

// Largest angle of the line from pelvis to head with the vertical. [rad]
double lean_of(const RobotModel& robot, const RobotMotion& motion) {
  const auto head = std::find_if(robot.keypoints.begin(), robot.keypoints.end(),
                                 [](const Keypoint& key) { return key.smpl == kHead; });
  Kinematics kinematics(robot);
  double lean = 0.0;
  for (int t = 0; t < motion.frames(); ++t) {
    kinematics.update(motion.root[t], motion.q.col(t));
    const Eigen::Vector3d up =
        kinematics.frame_position(head->frame) - kinematics.frame_position(robot.pairs.front().frame);
    lean = std::max(lean, std::atan2(up.head<2>().norm(), up.z()));
  }
  return lean;
}

TEST(RetargetLaws, HoldOverSyntheticClipsOfAllTasks) {
  for (const Task task : kPaperTasks) expect_laws(clip_of_task(task), test::g1());
}

TEST(RetargetLaws, HoldOnARobotWithOtherArms) {
  for (const Task task : {Task::kHandshake, Task::kWave}) expect_laws(clip_of_task(task), t1());
}

TEST(RetargetLaws, HoldOverARecording) {
  const std::string file = test::shared_file("data/k3hi/k3hi-shaking-1.npz");
  if (file.empty()) GTEST_SKIP() << "not run: data/k3hi absent";
  const std::vector<std::string> paths = {file};
  PeopleOptions options;
  options.task = Task::kHandshake;
  const PeopleFormat& format = find_people_format(paths);
  InteractionClip clip = read_source_clip(format, format.find(paths, options).front(), options).clip;
  for (HumanMotion* motion : {&clip.a, &clip.b}) *motion = resample(*motion, 50.0);
  clip.phases = {};
  clip.contacts.clear();
  expect_laws(clip, test::g1());
}

TEST(RetargetLaws, NoJointIsQuickerThanItsLimit) {
  for (const RobotModel* robot : {&test::g1(), &t1()}) {
    for (const Task task : {Task::kHug, Task::kHighFive}) {
      const InteractionClip clip = clip_of_task(task);
      const PairedMotion motion = retarget(clip, *robot, pair_options_of(PairMode::kBest));
      const auto figures = grounding_metrics(motion, *robot);
      EXPECT_EQ(figures.at("speed_violations"), 0.0) << clip.id << " on " << robot->name;
      EXPECT_LT(figures.at("sole_height"), 1e-3);
      EXPECT_LT(figures.at("foot_skate"), 0.03);
    }
  }
}

// A person who stands still before one who bows.
TEST(RetargetLaws, WhoStandsUprightBeforeABowStaysUpright) {
  InteractionClip clip = clip_of_task(Task::kBend);
  HumanMotion& still = clip.reactor == Person::kA ? clip.a : clip.b;
  const HumanMotion bowing = still;
  const int standing = clip.phases.act_begin;
  for (int t = standing; t < still.frames(); ++t) {
    still.joints.frame(t) = bowing.joints.frame(standing);
    for (int joint = 0; joint < kSmplJoints && !still.rotations.empty(); ++joint)
      still.rotations[static_cast<std::size_t>(t) * kSmplJoints + joint] =
          bowing.rotations[static_cast<std::size_t>(standing) * kSmplJoints + joint];
  }
  clip.contacts.clear();
  const PairedMotion motion = retarget(clip, test::g1(), pair_options_of(PairMode::kBest));
  EXPECT_LT(lean_of(test::g1(), motion.robot), 0.21);  // 12 degrees; the other bows by 50
  const PairedMotion both = retarget(clip_of_task(Task::kBend), test::g1(), pair_options_of(PairMode::kBest));
  EXPECT_GT(lean_of(test::g1(), both.robot), 0.7);  // and who bows, bows
}

TEST(JointSpeeds, KeepWhatIsSlowAndBoundTheRest) {
  const RobotModel& robot = test::g1();
  RobotMotion motion;
  motion.rate_hz = 50.0;
  motion.joint_names = robot.joint_names();
  motion.q = Eigen::MatrixXd::Zero(robot.dof(), 60);
  motion.root.resize(60);
  for (int t = 0; t < 60; ++t) {
    motion.q(3, t) = t < 30 ? 0.1 : 2.4;                // a jump
    motion.q(4, t) = 0.3 * std::sin(0.1 * t);           // slow
    motion.q(18, t) = t == 40 ? 2.0 : 0.01 * t;         // one frame off
    motion.q(20, t) = 0.7 * std::pow(-1.0, t) - 0.123;  // to and fro
  }
  RobotMotion backwards = motion;
  backwards.q = motion.q.rowwise().reverse();
  RobotMotion bounded = motion;
  keep_joint_speeds(robot, bounded);
  EXPECT_EQ(bounded.q.row(4), motion.q.row(4));
  EXPECT_EQ(bounded.q.row(18).head(20), motion.q.row(18).head(20));
  for (int j = 0; j < robot.dof(); ++j) {
    const double step = robot.joints[static_cast<std::size_t>(j)].velocity / 50.0;
    const Eigen::RowVectorXd q = bounded.q.row(j);
    EXPECT_LE((q.tail(59) - q.head(59)).cwiseAbs().maxCoeff(), step);
    EXPECT_GE(q.minCoeff(), motion.q.row(j).minCoeff());
    EXPECT_LE(q.maxCoeff(), motion.q.row(j).maxCoeff());
  }
  keep_joint_speeds(robot, backwards);
  EXPECT_EQ(backwards.q.rowwise().reverse().eval(), bounded.q);
  RobotMotion nearby = motion;
  nearby.q.array() += 1e-3 * Eigen::ArrayXXd::Random(robot.dof(), 60);
  keep_joint_speeds(robot, nearby);
  EXPECT_LE(farthest(nearby.q, bounded.q), 1e-3 * (1.0 + 1e-9));
  RobotMotion again = bounded;
  keep_joint_speeds(robot, again);
  EXPECT_EQ(again.q, bounded.q);
  motion.q.conservativeResize(5, 60);
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { keep_joint_speeds(robot, motion); }),
              testing::HasSubstr("expected a motion of this robot"));
}

}  // namespace
}  // namespace duet
