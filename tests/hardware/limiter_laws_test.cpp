// The limiter beside a person.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "duet/core/numbers.h"
#include "duet/core/recording.h"
#include "tests/hardware/limited_robot.h"

namespace duet {
namespace {

using test::LimitedRobot;

struct Meeting : LimitedRobot {
  explicit Meeting(double distance, const std::vector<TouchPair>& touches = {})
      : Meeting(distance, setup_with(touches)) {}
  Meeting(double distance, const LimiterSetup& setup)
      : LimitedRobot(setup), adult(test::standing_adult({distance, 0.0, 0.95})) {
    input.person = &adult;
    command.root.forward = 0.25;
  }
  static LimiterSetup setup_with(const std::vector<TouchPair>& touches) {
    LimiterSetup setup = test::beside_an_adult();
    setup.touches = touches;
    return setup;
  }
  double speed_after(int ticks) {
    for (int k = 0; k < ticks; ++k) tick();
    return out.root.forward;
  }
  HumanJoints adult;
};

TEST(LimiterBesideAPerson, FarAwayItWalks) {
  Meeting meeting(4.0);
  EXPECT_NEAR(meeting.speed_after(100), 0.25, 1e-6);
  EXPECT_EQ(meeting.counted(ClampReason::kSeparation), 0);
}

TEST(LimiterBesideAPerson, WithinReachOfAPersonsStepItStands) {
  Meeting meeting(1.2);
  EXPECT_EQ(meeting.speed_after(50), 0.0);
  EXPECT_EQ(meeting.counted(ClampReason::kSeparation), 50);
}

// S = vh (Tr + Ts) + v (Tr + Ts / 2) + Z solved for v: what the root's gait needs is the root's, the rest the arms'.
TEST(LimiterBesideAPerson, ItWalksAsAskedOrStandsAndTheArmsHaveTheRest) {
  const int elbow = test::g1()->roles.arms[0][3];
  const auto allowed_at = [](const Meeting& meeting) {
    BodyDistance distance(test::g1(), test::adult_body(), {});
    const BodyGaps& gaps = distance.measure(meeting.input.state.X_WB, meeting.out.q, &meeting.adult, 0.10, false);
    return (gaps.person - 1.6 * 0.73 - 0.1) / 0.43;
  };
  Meeting far(1.8), near(1.7);
  for (Meeting* meeting : {&far, &near}) meeting->command.q[elbow] -= 1.0;
  EXPECT_NEAR(far.speed_after(60), 0.25, 1e-6);
  const double left = allowed_at(far) - 0.25;
  ASSERT_GT(left, 0.01);
  ASSERT_LT(left, 0.5 * 0.6);
  const double before = far.out.q[elbow];
  far.tick();
  EXPECT_NEAR(std::abs(far.out.q[elbow] - before) / 0.02, left / 0.6, 0.01);
  EXPECT_EQ(near.speed_after(60), 0.0);
  ASSERT_GT(allowed_at(near), 0.01);
  ASSERT_LT(allowed_at(near), 0.25);
  EXPECT_GT(far.counted(ClampReason::kSeparation), 0);
}

TEST(LimiterBesideAPerson, AFasterPersonIsKeptFurtherAway) {
  Meeting meeting(2.6);
  EXPECT_GT(meeting.speed_after(100), 0.1);
  meeting.input.person_speed = 3.0;
  EXPECT_NEAR(meeting.speed_after(100), 0.0, 1e-6);
}

TEST(LimiterBesideAPerson, NobodyMovesBesideAPersonWhoIsNotSeen) {
  Meeting unseen(4.0);
  unseen.input.person = nullptr;
  EXPECT_EQ(unseen.speed_after(10), 0.0);
  EXPECT_EQ(unseen.counted(ClampReason::kPartnerUnknown), 10);
  Meeting lost(4.0);
  lost.input.odometry = false;  // whose frame the person's joints are in
  EXPECT_EQ(lost.speed_after(10), 0.0);
  EXPECT_EQ(lost.counted(ClampReason::kPartnerUnknown), 10);
}

const std::vector<TouchPair> kHug = {{"hand", "hand"},       {"hand", "forearm"}, {"forearm", "hand"},
                                     {"forearm", "forearm"}, {"hand", "chest"},   {"hand", "abdomen"},
                                     {"hand", "thigh"},      {"hand", "pelvis"}};

// Somebody who is held in the arms is let out of them; the root does not push on.
TEST(LimiterBesideAPerson, DuringTheActTheArmsCreepHoweverNearSomebodyIs) {
  const int elbow = test::g1()->roles.arms[0][3];
  Meeting before(0.5, kHug), during(0.5, kHug);
  during.input.acting = true;
  for (Meeting* meeting : {&before, &during}) meeting->command.q[elbow] -= 0.4;
  const double from = during.out.q.size() > 0 ? during.out.q[elbow] : during.input.state.q[elbow];
  EXPECT_EQ(before.speed_after(100), 0.0);
  EXPECT_EQ(during.speed_after(100), 0.0);
  EXPECT_EQ(before.out.q[elbow], from);
  EXPECT_LT(during.out.q[elbow], from - 0.1);
}

// Somebody further away reaches out: only their hand is near, and what may not touch leaves most of the speed.
void reach_out(Meeting& meeting) {
  constexpr int kElbow = 18, kWrist = 20, kHand = 22;
  for (const auto& [joint, x] : {std::pair(kElbow, 0.90), std::pair(kWrist, 0.63), std::pair(kHand, 0.55)})
    meeting.adult.col(joint) = Eigen::Vector3d(x, 0.2, 0.85);
  meeting.input.acting = true;
}

TEST(LimiterBesideAPerson, ATouchIsNoFasterThanItsRegionBears) {
  LimiterSetup setup = Meeting::setup_with(kHug);
  Meeting usual(2.2, setup);
  reach_out(usual);
  EXPECT_GT(usual.speed_after(100), 0.15);
  EXPECT_EQ(usual.counted(ClampReason::kTouchSpeed), 0);
  for (RegionLimits& region : setup.contact_limits.regions) region.quasi_static_n = 5.0;
  Meeting weak(2.2, setup);
  reach_out(weak);
  EXPECT_LT(weak.speed_after(100), 0.02);
  EXPECT_EQ(weak.counted(ClampReason::kTouchSpeed), 100);
}

TEST(LimiterBesideAPerson, TheRootDoesNotGoTowardsAHead) {
  // Bent down to the robot: a head at its own height, nothing else near.
  Meeting meeting(3.0, kHug);
  meeting.input.acting = true;
  for (int j : {kNeck, kHead}) meeting.adult.col(j) += Eigen::Vector3d(-2.4, 0.0, -0.35);
  EXPECT_LE(meeting.speed_after(60), 1e-9);
  EXPECT_GT(meeting.counted(ClampReason::kHeadDistance), 0);
}

TEST(LimiterBesideAPerson, AnArmStopsBeforeAHead) {
  Meeting meeting(3.0);
  meeting.command.root.forward = 0.0;
  const auto& arm = test::g1()->roles.arms[0];
  BodyDistance distance(test::g1(), test::adult_body(), {});
  // A head half a metre in front of the left hand's way, and a person who is told to stand still.
  for (int j : {kNeck, kHead}) meeting.adult.col(j) = Eigen::Vector3d(0.62, 0.2, j == kHead ? 1.15 : 1.0);
  meeting.input.acting = true;
  meeting.command.q[arm[0]] = -1.2;
  meeting.command.q[arm[3]] = 1.5;
  double nearest = BodyGaps::kFar;
  for (int k = 0; k < 400; ++k) {
    meeting.move();
    nearest =
        std::min(nearest, distance.measure(meeting.input.state.X_WB, meeting.out.q, &meeting.adult, 0.10, true).head);
  }
  EXPECT_GT(nearest, 0.245);
}

// A million random inputs, good and absurd: whatever comes in, what goes out is finite and inside every limit.

constexpr double kRounding = 1e-9;
constexpr double kRateRounding = 1e-6;  // rounding of a value over a tick
#if defined(DUET_SANITIZED)
constexpr int kEpisodes = 10;  // each tick takes ten times as long
#else
constexpr int kEpisodes = 500;
#endif
constexpr int kTicks = 2000;  // of an episode

double absurd(Random& random) {
  constexpr double kValues[] = {1e30, -1e30, 1e308, 5e-324, -0.0, 0.0};
  if (random.chance(0.3)) return std::numeric_limits<double>::quiet_NaN();
  if (random.chance(0.3)) return std::numeric_limits<double>::infinity();
  return kValues[random.below(6)];
}

double number(Random& random, double size) {
  return random.chance(0.02) ? absurd(random) : random.uniform(-size, size);
}

void draw_command(Random& random, MotionCommand& command) {
  command.stamp += random.chance(0.05) ? -0.01 : 0.02;
  command.root = {number(random, 0.6), number(random, 0.6), number(random, 2.0), 0.74 + number(random, 0.3)};
  const int joint = random.below(static_cast<int>(command.q.size()));
  command.q[joint] = random.chance(0.01) ? absurd(random) : random.uniform(-4.0, 4.0);
  if (!std::isfinite(command.q[joint]) && random.chance(0.5)) command.q[joint] = 0.0;
}

// The robot follows its targets, or does not, or is pushed.
void move_robot(Random& random, const LimitedCommand& out, LimiterInput& input) {
  input.state.q += random.uniform(0.0, 0.3) * (out.q - input.state.q);
  if (random.chance(0.02)) input.state.q[random.below(29)] += random.uniform(-0.3, 0.3);
  input.state.X_WB.p.x() += random.uniform(-0.05, 0.05);
  input.state.X_WB.R = yaw_rotation(random.uniform(-3.2, 3.2));
  if (random.chance(0.01)) input.share = random.chance(0.2) ? absurd(random) : random.uniform(-0.5, 1.5);
  if (random.chance(0.01)) input.odometry = !input.odometry;
  if (random.chance(0.005)) input.release = !input.release;
}

void check_axis(const char* name, const AxisState& now, const AxisState& before, const AxisBounds& bounds, double dt) {
  ASSERT_TRUE(std::isfinite(now.value)) << name;
  ASSERT_LE(now.value, std::max(bounds.upper, before.value) + kRounding) << name;
  ASSERT_GE(now.value, std::min(bounds.lower, before.value) - kRounding) << name;
  ASSERT_LE(std::abs(now.rate), bounds.stop_rate + kRounding) << name;
  ASSERT_LE(std::abs(now.rate - before.rate), bounds.rate_change * dt + kRounding) << name;
  ASSERT_NEAR(now.value, before.value + now.rate * dt, kRateRounding) << name;
}

void check_gains(const LimiterSetup& setup, const LimiterInput& input, const LimitedCommand& out) {
  ASSERT_TRUE(out.q.allFinite() && out.kp.allFinite() && out.kd.allFinite());
  for (const int j : setup.executed.joints) {
    const double torque = out.kp[j] * (out.q[j] - input.state.q[j]) - out.kd[j] * input.state.v[j];
    ASSERT_LE(std::abs(torque), setup.limits.torque_share * setup.robot->joints[j].effort + kRateRounding) << j;
    ASSERT_LE(out.kp[j], setup.executed.kp[j]);
    ASSERT_LE(out.kd[j], setup.executed.kd[j]);
  }
}

void check_tick(const Limiter& limiter, const LimiterInput& input, const LimiterState& before, const LimiterState& now,
                const LimitedCommand& out) {
  const HardwareLimits limits;
  const double dt = limiter.setup().dt;
  check_axis("forward", now.forward, before.forward, {-limits.backward, limits.forward, 0.5, 1.0, 5.0}, dt);
  check_axis("lateral", now.lateral, before.lateral, {-limits.lateral, limits.lateral, 0.5, 1.0, 5.0}, dt);
  check_axis("yaw", now.yaw, before.yaw, {-limits.yaw_rate, limits.yaw_rate, 1.5, 1.5, 5.0}, dt);
  check_axis("height", now.height, before.height, {0.64, 0.84, 0.1, 0.1, 0.5}, dt);
  for (const int j : limiter.setup().executed.joints)
    check_axis("joint", now.joints[j], before.joints[j], limiter.joint_bounds(j), dt);
  check_gains(limiter.setup(), input, out);
  ASSERT_EQ(out.root.forward, now.forward.value);
}

TEST(LimiterFuzz, AMillionInputsLeaveNoOutputOutsideItsLimits) {
  Random random(19, 2);
  Limiter limiter(test::nobody_near());
  ClampCounts counts{};
  LimitedCommand out;
  for (int episode = 0; episode < kEpisodes; ++episode) {
    LimiterInput input;
    input.state = test::g1()->standing_state();
    input.odometry = true;
    input.share = 1.0;
    LimiterState state = limiter.start(input.state), before;
    MotionCommand command{.stamp = 0.0, .root = {}, .q = input.state.q};
    for (int k = 0; k < kTicks; ++k) {
      draw_command(random, command);
      before = state;
      limiter.tick(random.chance(0.9) ? &command : nullptr, input, state, out, counts);
      ASSERT_NO_FATAL_FAILURE(check_tick(limiter, input, before, state, out)) << episode << " " << k;
      move_robot(random, out, input);
    }
  }
  for (const ClampReason reason :
       {ClampReason::kNotFinite, ClampReason::kStamp, ClampReason::kHold, ClampReason::kNoOdometry, ClampReason::kFence,
        ClampReason::kRelease, ClampReason::kRootSpeed, ClampReason::kRootAcceleration, ClampReason::kRootJerk,
        ClampReason::kHeight, ClampReason::kJointLimit, ClampReason::kJointSpeed, ClampReason::kJointAcceleration,
        ClampReason::kJointLead, ClampReason::kJointTorque, ClampReason::kSelfCollision})
    EXPECT_GT(counted(counts, reason), 0) << kClampNames[static_cast<std::size_t>(reason)];
}

TEST(LimiterFuzz, TheSameInputsGiveTheSameBits) {
  Random random(19, 3);
  Limiter first(test::nobody_near()), second(test::nobody_near());
  LimiterInput input;
  input.state = test::g1()->standing_state();
  input.odometry = true;
  input.share = 1.0;
  LimiterState a = first.start(input.state), b = a;
  MotionCommand command{.stamp = 0.0, .root = {}, .q = input.state.q};
  ClampCounts counts{};
  LimitedCommand out_a, out_b;
  for (int k = 0; k < 1000; ++k) {
    draw_command(random, command);
    LimiterState elsewhere = first.start(input.state);
    second.tick(nullptr, input, elsewhere, out_b, counts);  // leaves no trace
    first.tick(&command, input, a, out_a, counts);
    second.tick(&command, input, b, out_b, counts);
    ASSERT_TRUE(out_a.q == out_b.q && out_a.kp == out_b.kp && out_a.root.forward == out_b.root.forward) << k;
    move_robot(random, out_a, input);
  }
}

}  // namespace
}  // namespace duet
