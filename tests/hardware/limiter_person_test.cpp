// The limiter beside a person.
#include <gmock/gmock.h>

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

}  // namespace
}  // namespace duet
