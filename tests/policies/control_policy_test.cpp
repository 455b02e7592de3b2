// Controls do what their names say, whatever is asked of them, and nothing that a robot cannot do.
#include "duet/policies/controls/control_policy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <set>

#include "duet/core/task.h"
#include "duet/robots/roles.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;

// A partner of 1.7 m at (ahead, 0), right hand at `hand`; the robot stands at the origin and looks at it.
ObservationFrame facing(const RobotModel& robot, double ahead, const Eigen::Vector3d& hand) {
  ObservationFrame frame;
  frame.robot = robot.standing_state({});
  for (int joint = 0; joint < kSmplJoints; ++joint) frame.partner.col(joint) = Eigen::Vector3d(ahead, 0.0, 1.0);
  frame.partner.col(kLeftHand) = Eigen::Vector3d(ahead, -0.3, 0.8);
  frame.partner.col(kRightHand) = hand;
  return frame;
}

std::vector<Reference> planned(std::string_view name, Task task, const ObservationFrame& frame, int tick = 0) {
  const auto robot = g1();
  const std::unique_ptr<Policy> policy = control_maker(name, robot)();
  EpisodeContext context{.task = task, .prompt = "", .start = frame.robot};
  policy->reset(context);
  return policy->plan({.history = std::span(&frame, 1), .tick = tick});
}

Eigen::Vector3d hand_of(const RobotModel& robot, const Reference& reference, const char* hand) {
  Kinematics kinematics(robot);
  kinematics.update(reference.X_WB, reference.q);
  return kinematics.frame_position(robot.track_frame(hand));
}

TEST(ControlPolicy, PlansWhatARobotCanDo) {
  const auto robot = g1();
  const ObservationFrame frame = facing(*robot, 1.2, {0.8, 0.1, 1.0});
  for (const ControlScript& script : control_scripts()) {
    for (const Task task : all_tasks()) {
      for (const int tick : {0, 37, 120, 260}) {
        const std::vector<Reference> plan = planned(script.name, task, frame, tick);
        ASSERT_EQ(plan.size(), 100U);
        for (const Reference& reference : plan) {
          ASSERT_TRUE(reference.q.allFinite());
          EXPECT_NEAR(reference.X_WB.R.norm(), 1.0, 1e-9);
          for (int j = 0; j < robot->dof(); ++j) {
            EXPECT_GE(reference.q[j], robot->joints[j].lower) << script.name << " " << robot->joints[j].name;
            EXPECT_LE(reference.q[j], robot->joints[j].upper) << script.name << " " << robot->joints[j].name;
          }
          EXPECT_LE((reference.X_WB.p - frame.robot.X_WB.p).head<2>().norm(), 1.0) << script.name;
        }
      }
    }
  }
}

TEST(ControlPolicy, AllButOneAreBlindToTheCommand) {
  const auto robot = g1();
  const ObservationFrame frame = facing(*robot, 1.2, {0.8, 0.1, 1.0});
  for (const ControlScript& script : control_scripts()) {
    std::set<std::string> kinds;
    for (const Task task : all_tasks()) {
      std::string text;
      for (const Reference& reference : planned(script.name, task, frame, 40))
        for (const double q : reference.q) text += std::to_string(q);
      kinds.insert(text);
    }
    EXPECT_EQ(kinds.size() > 1, script.told) << script.name;
  }
}

TEST(ControlPolicy, AFollowingHandComesToThePartners) {
  const auto robot = g1();
  const Eigen::Vector3d hand(0.35, -0.1, 0.95);  // within reach
  const ObservationFrame frame = facing(*robot, 0.8, hand);
  for (const auto& [name, own] : {std::pair{"servo", "rhand"}, {"omni", "lhand"}}) {
    const std::unique_ptr<Policy> policy = control_maker(name, robot)();
    EpisodeContext context;
    context.start = frame.robot;
    policy->reset(context);
    std::vector<Reference> plan;
    for (int call = 0; call < 8; ++call) plan = policy->plan({.history = std::span(&frame, 1), .tick = 0});
    EXPECT_LT((hand_of(*robot, {frame.robot.X_WB, plan.front().q}, own) - hand).norm(), 0.05) << name;
  }
}

TEST(ControlPolicy, StandsWalksAndRaises) {
  const auto robot = g1();
  const ObservationFrame frame = facing(*robot, 2.0, {1.6, 0.1, 1.0});
  EXPECT_EQ(planned("raised", Task::kHug, frame).back().X_WB.p, frame.robot.X_WB.p);
  EXPECT_NEAR(planned("walker", Task::kHug, frame).back().X_WB.p.x(), 0.45 * 99 / 50.0, 1e-6);
  const Reference raised = planned("raised", Task::kBend, frame).front();
  Kinematics kinematics(*robot);
  kinematics.update(raised.X_WB, raised.q);
  EXPECT_GT(kinematics.frame_position(robot->track_frame("rhand")).z(),
            kinematics.frame_position(robot->track_frame("rshoulder")).z() + 0.1);
}

// Its arm hangs until a hand of the partner is raised, and follows that from then on, lowered again or not.
TEST(ControlPolicy, APatientOneWaitsForARaisedHand) {
  const auto robot = g1();
  const ObservationFrame low = facing(*robot, 0.8, {0.35, -0.1, 0.8}), high = facing(*robot, 0.8, {0.35, -0.1, 0.95});
  const std::unique_ptr<Policy> policy = control_maker("patient", robot)();
  EpisodeContext context;
  context.start = low.robot;
  policy->reset(context);
  const auto hand_in_plan = [&](const ObservationFrame& frame) {
    const std::vector<Reference> plan = policy->plan({.history = std::span(&frame, 1), .tick = 0});
    return hand_of(*robot, {frame.robot.X_WB, plan.front().q}, "rhand");
  };
  const Eigen::Vector3d hanging = hand_of(*robot, {low.robot.X_WB, robot->neutral}, "rhand");
  for (int call = 0; call < 8; ++call) EXPECT_LT((hand_in_plan(low) - hanging).norm(), 1e-9);
  for (int call = 0; call < 8; ++call) (void)hand_in_plan(high);
  EXPECT_LT((hand_in_plan(high) - high.partner.col(kRightHand)).norm(), 0.05);
  for (int call = 0; call < 8; ++call) (void)hand_in_plan(low);
  EXPECT_GT((hand_in_plan(low) - hanging).norm(), 0.05);
  policy->reset(context);
  EXPECT_LT((hand_in_plan(low) - hanging).norm(), 1e-9) << "the next episode begins anew";
}

// The partner's hand is before its shoulder, a third of its arm's length up; so is the robot's.
TEST(ControlPolicy, AMirrorDoesAsThePartner) {
  const auto robot = g1();
  ObservationFrame frame = facing(*robot, 1.5, {1.2, 0.2, 1.6});
  const Eigen::Vector3d shoulder(1.5, 0.2, 1.4);
  frame.partner.col(kRightShoulder) = shoulder;
  frame.partner.col(kRightElbow) = shoulder + Eigen::Vector3d(-0.2, 0.0, 0.1);
  frame.partner.col(kRightWrist) = shoulder + Eigen::Vector3d(-0.3, 0.0, 0.2);
  frame.partner.col(kHead) = Eigen::Vector3d(1.2, 0.0, 1.5);  // bows towards the robot
  const std::unique_ptr<Policy> policy = control_maker("mirror", robot)();
  EpisodeContext context;
  context.start = frame.robot;
  policy->reset(context);
  std::vector<Reference> plan;
  for (int call = 0; call < 20; ++call) plan = policy->plan({.history = std::span(&frame, 1), .tick = 0});
  const Reference upright{frame.robot.X_WB, [&] {
                            Eigen::VectorXd q = plan.front().q;
                            for (const int joint : tilting_waist(*robot)) q[joint] = robot->neutral[joint];
                            return q;
                          }()};
  const Eigen::Vector3d arm = hand_of(*robot, upright, "rhand") - hand_of(*robot, upright, "rshoulder");
  EXPECT_GT(arm.x(), 0.15);
  EXPECT_GT(arm.z(), 0.1);
  EXPECT_NEAR(arm.y(), 0.0, 0.05);
  const Eigen::Vector3d up = plan.front().X_WB.R * Eigen::Vector3d::UnitZ();
  EXPECT_GT(std::atan2(up.x(), up.z()), 0.1);
}

TEST(ControlPolicy, OfAnotherNameIsNone) {
  EXPECT_FALSE(is_control("dstar"));
  EXPECT_TRUE(is_control("omni"));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)control_maker("dstar", g1()); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)control_maker("omni", nullptr); }));
}

TEST(ArmLength, OfAG1IsHalfAMetre) {
  const auto robot = g1();
  for (const int side : {0, 1}) EXPECT_NEAR(arm_length(*robot, side), 0.5, 0.1);
  EXPECT_NEAR(arm_length(*robot, 0), arm_length(*robot, 1), 1e-3);
}

}  // namespace
}  // namespace duet
