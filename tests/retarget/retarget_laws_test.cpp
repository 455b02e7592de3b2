// Laws of mode `best` (tests/retarget/retarget_laws.h); joints keep their speeds; a person who stands upright becomes a
// robot that does.
#include "tests/retarget/retarget_laws.h"

#include <algorithm>
#include <cmath>

#include "duet/metrics/locomotion.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/retarget/solver/pair.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/roles.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::expect_laws;
using test::farthest;

const RobotModel& t1() {
  static const RobotModel model = load_robot(card_path("t1"));
  return model;
}

InteractionClip clip_of_task(Task task) { return synthesize(task, {.seed = 42}); }

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
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { keep_joint_speeds(robot, motion); }));
}

}  // namespace
}  // namespace duet
