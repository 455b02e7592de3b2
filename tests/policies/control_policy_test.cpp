// Controls do what their names say, whatever is asked of them, and nothing that a robot cannot do.
#include "duet/policies/controls/control_policy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/core/task.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/language.h"
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

// The plan once the partner has raised its hands so far.
std::vector<Reference> planned(std::string_view name, Task task, const ObservationFrame& frame, int tick = 0) {
  const auto robot = g1();
  const std::unique_ptr<Policy> policy = control_maker(name, robot)();
  EpisodeContext context{.task = task, .prompt = "", .start = frame.robot};
  policy->reset(context);
  ObservationFrame before = frame;
  for (const int hand : {kLeftHand, kRightHand}) before.partner(2, hand) -= 0.3;
  (void)policy->plan({.history = std::span(&before, 1), .tick = 0});
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

TEST(ControlPolicy, AllButThoseThatAreToldAreBlindToTheCommand) {
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

// A maker's arm action looks at nobody, begins at once, is held where hands touch, and ends by itself.
TEST(ControlPolicy, VendorsArmsGoByTheClockAlone) {
  const auto robot = g1();
  const ObservationFrame here = facing(*robot, 1.2, {0.8, 0.1, 1.0}), there = facing(*robot, 2.5, {2.5, 0.3, 1.6});
  const Reference rest{here.robot.X_WB, robot->neutral};
  const auto right = [&](Task task, int tick) {
    return hand_of(*robot, planned("vendor", task, here, tick).front(), "rhand");
  };
  const Eigen::Vector3d hanging = hand_of(*robot, rest, "rhand");
  // Those that the maker has an action for: no bow, no fist bump.
  const std::set<Task> presets = {Task::kHug, Task::kHandshake, Task::kHighFive, Task::kWave, Task::kFlyKiss};
  for (const Task task : all_tasks()) {
    for (const int tick : {0, 30, 150, 600}) {
      const std::vector<Reference> a = planned("vendor", task, here, tick), b = planned("vendor", task, there, tick);
      for (std::size_t k = 0; k < a.size(); ++k) ASSERT_EQ(a[k].q, b[k].q) << to_string(task) << tick;
      EXPECT_EQ(a.back().X_WB.p, here.robot.X_WB.p) << "it stands";
    }
    EXPECT_LT((right(task, 1100) - hanging).norm(), 1e-6) << to_string(task);
    const double moved = (right(task, 60) - hanging).norm();
    EXPECT_EQ(moved > 0.2, presets.contains(task)) << to_string(task);
  }
  EXPECT_GT((right(Task::kHandshake, 900) - hanging).norm(), 0.2);
  EXPECT_LT((right(Task::kWave, 320) - hanging).norm(), 1e-6);
  EXPECT_GT(std::abs(right(Task::kHandshake, 150).z() - right(Task::kHandshake, 166).z()), 0.02) << "it shakes";
  const auto apart = [&](int tick) {
    const Reference hug = planned("vendor", Task::kHug, here, tick).front();
    return (hand_of(*robot, hug, "lhand") - hand_of(*robot, hug, "rhand")).norm();
  };
  EXPECT_GT(apart(60), apart(140) + 0.2) << "its arms close";
  // A command to be first changes nothing: it always is.
  const EpisodeContext leading{
      .task = Task::kHandshake, .prompt = leading_prompt(task_prompt(Task::kHandshake)), .start = here.robot};
  const std::unique_ptr<Policy> first = control_maker("vendor", robot)();
  first->reset(leading);
  const std::vector<Reference> plan = first->plan({.history = std::span(&here, 1), .tick = 300});
  EXPECT_EQ(plan.front().q, planned("vendor", Task::kHandshake, here, 300).front().q);
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

// A policy of that name, which is asked again and again.
class Control {
 public:
  Control(std::string_view name, Task task, std::string prompt, const RobotState& start)
      : robot_(g1()), policy_(control_maker(name, robot_)()) {
    policy_->reset({.task = task, .prompt = std::move(prompt), .start = start});
  }
  Reference at(const ObservationFrame& frame, int tick) {
    return policy_->plan({.history = std::span(&frame, 1), .tick = tick}).front();
  }
  double hand_height(const ObservationFrame& frame, int tick) { return hand_of(*robot_, at(frame, tick), "rhand").z(); }
  double lean(const ObservationFrame& frame, int tick) {
    const Eigen::Vector3d up = at(frame, tick).X_WB.R * Eigen::Vector3d::UnitZ();
    return std::atan2(up.x(), up.z());
  }

 private:
  std::shared_ptr<const RobotModel> robot_;
  std::unique_ptr<Policy> policy_;
};

// It stands until the partner raises a hand, whenever that is, and then does its gesture from the beginning, once.
TEST(ControlPolicy, AWaitingOneBeginsWithItsPartner) {
  const auto robot = g1();
  const ObservationFrame low = facing(*robot, 2.0, {1.9, 0.2, 0.8}), high = facing(*robot, 2.0, {1.6, 0.2, 1.2});
  for (const Task task : {Task::kWave, Task::kFlyKiss}) {
    Control waiting("waiting", task, "", low.robot);
    const double hanging = waiting.hand_height(low, 0);
    for (const int tick : {10, 200, 430}) EXPECT_EQ(waiting.hand_height(low, tick), hanging);
    (void)waiting.at(high, 440);
    EXPECT_GT(waiting.hand_height(low, 440 + 40), hanging + 0.2) << "it goes on though the partner has ended";
  }
  Control kiss("waiting", Task::kFlyKiss, "", low.robot);
  const double hanging = kiss.hand_height(low, 0);
  (void)kiss.hand_height(high, 10);
  EXPECT_NEAR(kiss.hand_height(low, 10 + 200 + 40), hanging, 1e-9);
}

// 6 cm of noise on a partner who hangs their arms wake it; on the mean of a quarter of a second they do not.
TEST(ControlPolicy, OneThatAveragesIsNotWokenByNoise) {
  const auto robot = g1();
  const auto wakes = [&](const char* average) {
    const std::unique_ptr<Policy> policy = make_policy("waiting", robot, {{"average", average}});
    const ObservationFrame low = facing(*robot, 2.0, {1.9, 0.2, 0.8});
    policy->reset({.task = Task::kWave, .prompt = "", .start = low.robot});
    Random random(3, 5);
    std::vector<ObservationFrame> history(kHistoryFrames, low);
    double highest = 0.0;
    for (int tick = 0; tick < 500; tick += 10) {
      for (ObservationFrame& frame : history) {
        frame = low;
        for (Eigen::Index k = 0; k < frame.partner.size(); ++k) frame.partner.data()[k] += 0.06 * random.normal();
      }
      for (const Reference& reference : policy->plan({history, tick}))
        highest = std::max(highest, hand_of(*robot, reference, "rhand").z());
    }
    return highest > 1.0;
  };
  EXPECT_TRUE(wakes("false"));
  EXPECT_FALSE(wakes("true"));
}

TEST(ControlPolicy, AWaitingOneBowsToABow) {
  const auto robot = g1();
  ObservationFrame upright = facing(*robot, 2.0, {1.9, 0.2, 0.8});
  upright.partner.col(kHead) = Eigen::Vector3d(2.0, 0.0, 1.6);
  ObservationFrame bowed = upright;
  bowed.partner.col(kHead) = Eigen::Vector3d(1.8, 0.0, 1.55);
  Control waiting("waiting", Task::kBend, "", upright.robot);
  for (const int tick : {0, 100, 300}) EXPECT_EQ(waiting.lean(upright, tick), 0.0);
  (void)waiting.lean(bowed, 310);
  EXPECT_GT(waiting.lean(bowed, 310 + 60), 0.2);
  EXPECT_NEAR(waiting.lean(upright, 310 + 260), 0.0, 1e-9) << "once";
}

// It is told to begin: nobody is waited for.
TEST(ControlPolicy, AWaitingOneThatIsToBeFirstIsACannedOne) {
  const auto robot = g1();
  const ObservationFrame still = facing(*robot, 2.0, {1.9, 0.2, 0.8});
  for (const Task task : {Task::kWave, Task::kBend, Task::kFlyKiss}) {
    Control waiting("waiting", task, leading_prompt(task_prompt(task)), still.robot);
    Control canned("canned", task, "", still.robot);
    for (const int tick : {0, 30, 60, 130, 270}) {
      const Reference own = waiting.at(still, tick), other = canned.at(still, tick);
      EXPECT_EQ(own.q, other.q) << to_string(task) << " " << tick;
      EXPECT_EQ(own.X_WB.R.coeffs(), other.X_WB.R.coeffs());
    }
  }
}

// It serves a hand for as long as that is raised.
TEST(ControlPolicy, AWaitingOneLetsGoOfALoweredHand) {
  const auto robot = g1();
  const ObservationFrame low = facing(*robot, 0.8, {0.35, -0.1, 0.8}), high = facing(*robot, 0.8, {0.35, -0.1, 1.05});
  Control waiting("waiting", Task::kHandshake, "", low.robot);
  const double hanging = waiting.hand_height(low, 0);
  for (int call = 1; call < 10; ++call) (void)waiting.at(high, 10 * call);
  EXPECT_GT(waiting.hand_height(high, 100), hanging + 0.1);
  EXPECT_NEAR(waiting.hand_height(low, 110), hanging, 1e-9);
}

// Its arms open when the partner raises a hand, and close where it has come near.
TEST(ControlPolicy, AWaitingOneEmbraces) {
  const auto robot = g1();
  const ObservationFrame low = facing(*robot, 0.9, {0.8, 0.2, 0.8}), high = facing(*robot, 0.9, {0.6, 0.2, 1.2});
  const ObservationFrame near = facing(*robot, 0.42, {0.1, 0.2, 1.2});
  Control waiting("waiting", Task::kHug, "", low.robot);
  const auto apart = [&](const ObservationFrame& frame, int tick) {
    const Reference reference = waiting.at(frame, tick);
    return (hand_of(*robot, reference, "lhand") - hand_of(*robot, reference, "rhand")).norm();
  };
  const Eigen::Vector3d hanging = hand_of(*robot, waiting.at(low, 0), "rhand");
  (void)apart(high, 10);
  const double open = apart(high, 60);
  EXPECT_GT(hand_of(*robot, waiting.at(high, 60), "rhand").z(), hanging.z() + 0.2);
  double closed = open;
  for (int call = 0; call < 20; ++call) closed = apart(near, 70 + 10 * call);
  EXPECT_LT(closed, open - 0.2);
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
