// The servo corrects where a plan has a hand near one that is held out, smoothly and within limits, and nowhere else.
#include "duet/policies/hand_servo.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "duet/policies/catalogue/registry.h"
#include "duet/robots/kinematics.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::thrown_message;
using ::testing::HasSubstr;

const HandServoBounds kBounds = hand_servo_bounds(HandServoReach::kNear, Task::kHandshake);
constexpr int kSeconds = 50;  // ticks

bool same_reference(const Reference& a, const Reference& b) {
  return a.q == b.q && a.X_WB.p == b.X_WB.p && a.X_WB.R.coeffs() == b.X_WB.R.coeffs();
}

// Holds one reference.
class Holding final : public Policy {
 public:
  explicit Holding(Reference reference) : reference_(std::move(reference)) {}
  [[nodiscard]] std::string_view name() const override { return "holding"; }
  void reset(const EpisodeContext&) override {}
  Anchors act(const Observation&) override {
    Anchors anchors;
    anchors.fill(reference_);
    return anchors;
  }

 private:
  Reference reference_;
};

// The robot stands at the origin with its right forearm level before it.
Reference offering() {
  const RobotState standing = g1()->standing_state({});
  Reference reference{standing.X_WB, standing.q};
  reference.q[g1()->joint_index("right_shoulder_pitch_joint")] = -0.4;
  reference.q[g1()->joint_index("right_elbow_joint")] = 0.6;
  return reference;
}

Eigen::Vector3d hand_of(const Reference& reference) {
  Kinematics kinematics(*g1());
  kinematics.update(reference.X_WB, reference.q);
  return kinematics.frame_position(g1()->track_frame("rhand"));
}

// A partner a metre ahead whose hands hang down.
ObservationFrame facing() {
  ObservationFrame frame;
  frame.robot = g1()->standing_state({});
  for (int joint = 0; joint < kSmplJoints; ++joint) frame.partner.col(joint) = Eigen::Vector3d(1.0, 0.0, 1.0);
  frame.partner.col(kLeftHand) = Eigen::Vector3d(1.0, -0.3, 0.5);
  frame.partner.col(kRightHand) = Eigen::Vector3d(1.0, 0.3, 0.5);
  return frame;
}

// The references of two seconds in which the partner's hand is at `hand` after a fifth of a second. The robot is where
// its plan wants it.
std::vector<Reference> corrected(Task task, const Reference& wanted, const Eigen::Vector3d& hand,
                                 const std::function<void(ObservationFrame&)>& disturb = {},
                                 HandServoReach reach = HandServoReach::kNear) {
  const std::unique_ptr<Policy> policy = with_hand_servo(std::make_unique<Holding>(wanted), g1(), reach);
  policy->reset({.task = task, .prompt = "", .start = facing().robot});
  ObservationHistory history;
  std::vector<Reference> references;
  for (int tick = 0; tick < 2 * kSeconds; ++tick) {
    ObservationFrame frame = facing();
    frame.robot.X_WB = wanted.X_WB;
    frame.robot.q = wanted.q;
    if (tick >= kTicksPerPlan) frame.partner.col(kRightHand) = hand;
    if (disturb) disturb(frame);
    history.add(frame);
    Reference reference = wanted;
    if (tick % kTicksPerPlan == 0) reference = policy->plan(history.at(tick)).at(0);
    if (policy->corrects()) policy->correct(history.at(tick), reference);
    references.push_back(reference);
  }
  return references;
}

// The partner's hand at the offered one: so far before it, and to the side.
Eigen::Vector3d held_out(double ahead, double aside = 0.0) {
  return hand_of(offering()) + Eigen::Vector3d(ahead, aside, 0.0);
}

// The IK's damping leaves some of the last millimetres.
TEST(HandServo, BringsTheHandToTheOneThatIsHeldOut) {
  for (const Eigen::Vector3d& hand : {held_out(-0.08), held_out(-0.1, 0.1), held_out(-0.1, -0.1)}) {
    EXPECT_GT((hand_of(offering()) - hand).norm(), 0.05);
    Reference reference = corrected(Task::kHandshake, offering(), hand).back();
    reference.X_WB = offering().X_WB;  // where the robot of this test stays, whatever is asked of its root
    EXPECT_LT((hand_of(reference) - hand).norm(), 0.01);
  }
}

// A hand that comes quickly is taken to go on.
TEST(HandServo, LeavesAPlanToTheBitThatIsFarFromTheHand) {
  for (const Reference& reference : corrected(Task::kHandshake, offering(), held_out(kBounds.far + 0.15)))
    EXPECT_TRUE(same_reference(reference, offering()));
}

// Half a metre, in the task whose hands have to stay together.
TEST(HandServo, GoesFartherInAHandshakeWhereItIsWide) {
  const auto moves = [](Task task, HandServoReach reach) {
    return !same_reference(corrected(task, offering(), held_out(kBounds.far + 0.15), {}, reach).back(), offering());
  };
  EXPECT_TRUE(moves(Task::kHandshake, HandServoReach::kWide));
  EXPECT_FALSE(moves(Task::kHandshake, HandServoReach::kNear));
  EXPECT_FALSE(moves(Task::kHighFive, HandServoReach::kWide));
  EXPECT_FALSE(moves(Task::kHug, HandServoReach::kWide));
}

// A hand that comes towards the robot at the height at which it was is held out for the wide servo alone.
TEST(HandServo, SeesALevelHandWhereItIsWide) {
  const Eigen::Vector3d hand = held_out(-0.05);
  const auto level = [&](ObservationFrame& frame) {
    if (frame.partner.col(kRightHand) != hand) frame.partner.col(kRightHand) = Eigen::Vector3d(1.0, hand.y(), hand.z());
  };
  const auto last = [&](HandServoReach reach) {
    return corrected(Task::kHandshake, offering(), hand, level, reach).back();
  };
  EXPECT_TRUE(same_reference(last(HandServoReach::kNear), offering()));
  EXPECT_FALSE(same_reference(last(HandServoReach::kWide), offering()));
}

TEST(HandServo, LeavesAPlanToTheBitWhoseHandIsNearOneThatHangs) {
  Reference low = offering();
  low.X_WB.p += facing().partner.col(kRightHand) - hand_of(low);
  for (const Reference& reference : corrected(Task::kHandshake, low, facing().partner.col(kRightHand)))
    EXPECT_TRUE(same_reference(reference, low));
}

TEST(HandServo, WorksInTasksOfHandAtHandAlone) {
  std::vector<Task> corrects;
  for (const Task task : all_tasks())
    if (!same_reference(corrected(task, offering(), held_out(0.08)).back(), offering())) corrects.push_back(task);
  EXPECT_EQ(task_names(corrects), (std::vector<std::string>{"handshake", "high_five", "fist_bump"}));
  for (const Task task : all_tasks())
    EXPECT_EQ(is_hand_to_hand(task), std::ranges::find(corrects, task) != corrects.end());
}

void expect_smooth(const std::vector<Reference>& references, const Reference& wanted) {
  constexpr double kRounding = 1e-12;
  Reference last = wanted;
  for (const Reference& reference : references) {
    EXPECT_LE((reference.q - last.q).cwiseAbs().maxCoeff(), kBounds.joint_rate / kTickRate + kRounding);
    EXPECT_LE((reference.X_WB.p - last.X_WB.p).norm(), kBounds.root_rate / kTickRate + kRounding);
    EXPECT_LE((reference.X_WB.p - wanted.X_WB.p).norm(), kBounds.root + kRounding);
    EXPECT_EQ(reference.X_WB.p.z(), wanted.X_WB.p.z());
    EXPECT_TRUE((reference.q.array() >= g1()->lower().array()).all());
    EXPECT_TRUE((reference.q.array() <= g1()->upper().array()).all());
    last = reference;
  }
}

TEST(HandServo, IsSmoothAndWithinLimitsWhateverItSees) {
  for (const double noise : {0.0, 0.03, 0.3}) {
    Random random(7, 1);
    const auto disturb = [&](ObservationFrame& frame) {
      for (double& value : frame.partner.reshaped()) value += noise * random.normal();
    };
    for (const Eigen::Vector3d& hand : {held_out(0.08), held_out(0.2), held_out(-0.15, -0.1)})
      for (const Task task : {Task::kHighFive, Task::kHandshake})
        for (const HandServoReach reach : {HandServoReach::kNear, HandServoReach::kWide})
          expect_smooth(corrected(task, offering(), hand, disturb, reach), offering());
  }
}

// A hand that vanishes is let go of, not dropped.
TEST(HandServo, LetsGoSmoothlyOfAHandThatIsNoLongerSeen) {
  int tick = 0;
  const auto vanish = [&](ObservationFrame& frame) {
    if (++tick > kSeconds) frame.partner.col(kRightHand).setConstant(std::nan(""));
  };
  const std::vector<Reference> references = corrected(Task::kHandshake, offering(), held_out(0.08), vanish);
  EXPECT_FALSE(same_reference(references[kSeconds - 1], offering()));
  expect_smooth(references, offering());
  EXPECT_TRUE(same_reference(references.back(), offering()));
}

TEST(HandServo, AsksTheRootForWhatTheArmLacks) {
  const auto level = [](const Reference& reference) { return (reference.X_WB.p - offering().X_WB.p).norm(); };
  EXPECT_EQ(level(corrected(Task::kHighFive, offering(), held_out(0.0, 0.08)).back()), 0.0);
  Reference stretched = offering();
  stretched.q[g1()->joint_index("right_shoulder_pitch_joint")] = -1.4;
  stretched.q[g1()->joint_index("right_elbow_joint")] = 1.4;
  const Eigen::Vector3d beyond = hand_of(stretched) + Eigen::Vector3d(0.12, 0.0, 0.0);
  EXPECT_GT(level(corrected(Task::kHighFive, stretched, beyond).back()), 0.02);
}

TEST(HandServo, IsAnOptionOfPoliciesAndOfScripts) {
  const RobotMotion motion = test::swinging_motion(100, 1);
  const auto corrects = [&](const PolicyOptions& options) {
    const std::unique_ptr<Policy> policy = make_policy("replay", g1(), options);
    policy->reset({.task = Task::kHandshake, .prompt = "", .start = {}, .hindsight = &motion});
    return policy->corrects();
  };
  EXPECT_FALSE(corrects({}));
  EXPECT_FALSE(corrects({{kHandServo, "false"}}));
  EXPECT_TRUE(corrects({{kHandServo, "true"}}));
  EXPECT_TRUE(corrects({{kHandServo, "wide"}}));
  EXPECT_EQ(policy_files("dstar", {{kHandServo, "true"}}).size(), policy_files("dstar").size());
  const auto refusal = [](const char* policy, const char* value) {
    return thrown_message<std::invalid_argument>([&] { make_policy(policy, g1(), {{kHandServo, value}}); });
  };
  EXPECT_THAT(refusal("replay", "maybe"), HasSubstr("unknown hand_servo 'maybe'. Known: false, true, wide"));
  EXPECT_EQ(refusal("null", "true"), "policy 'null': expected no option, found 'hand_servo'");
  EXPECT_NE(make_policy("patient", g1(), {{kHandServo, "wide"}}), nullptr);
}

TEST(HandServo, NeedsArms) {
  auto armless = std::make_shared<RobotModel>(*g1());
  armless->roles.arms = {};
  EXPECT_EQ(
      thrown_message<std::invalid_argument>([&] { with_hand_servo(std::make_unique<Holding>(offering()), armless); }),
      "policy 'holding': robot '" + g1()->name + "' has no arms in its card (roles.arms)");
}

// A body that lacks joints gets the correction of those that it has.
TEST(HandServo, ReachesThroughABodyOfOtherJoints) {
  const auto body = load_shared_robot("g1_27dof");
  const std::unique_ptr<Policy> policy =
      on_other_body(with_hand_servo(std::make_unique<Holding>(offering()), g1()), g1(), *body);
  policy->reset({.task = Task::kHandshake, .prompt = "", .start = body->standing_state({})});
  ASSERT_TRUE(policy->corrects());
  ObservationHistory history;
  Reference reference;
  for (int tick = 0; tick < kSeconds; ++tick) {
    ObservationFrame frame = facing();
    frame.robot = body->standing_state({});
    if (tick > 0) frame.partner.col(kRightHand) = held_out(0.05, 0.05);
    history.add(frame);
    if (tick % kTicksPerPlan == 0) reference = policy->plan(history.at(tick)).at(0);
    const Eigen::VectorXd before = reference.q;
    Reference moved = reference;
    policy->correct(history.at(tick), moved);
    ASSERT_EQ(moved.q.size(), body->dof());
    if (tick == kSeconds - 1) {
      EXPECT_GT((moved.q - before).norm(), 0.05);
    }
  }
}

}  // namespace
}  // namespace duet
