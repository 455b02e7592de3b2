// Recorded estimates of a person: their file, and what the robot would do beside them.
#include "duet/hardware/episodes/seen_person.h"

#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "duet/hardware/twin/fakes.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/policies/catalogue/registry.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr const char* kCamera = DUET_SOURCE_DIR "/examples/hardware/camera.yaml";

RobotConfig seeing(bool somebody_near = false) {
  RobotConfig config = read_robot_config(kCamera);
  config.person = somebody_near;
  config.limits.arm_speed = 1.5;
  return config;
}

// The partner of a synthetic clip, as the camera of that configuration sees them from where the robot stands.
std::vector<RecordedEstimate> clip_seen(Task task, const PersonPlay& play = {.noise = 0.0}) {
  const InteractionClip clip = synthesize(task, {});
  PersonPlayer player(clip.actor_motion(), base_of_reactor(clip.reactor_motion(), 0.74), seeing().camera.X_BC, play);
  std::vector<RecordedEstimate> log;
  PersonEstimate estimate;
  while (player.next(estimate)) log.push_back(recorded(estimate));
  return log;
}

std::unique_ptr<Policy> policy(const std::string& name) { return make_policy(name, test::g1()); }

TEST(PersonLog, IsReadAsItWasWritten) {
  const std::vector<RecordedEstimate> log = clip_seen(Task::kWave);
  std::string bytes = person_log(log);
  std::string first = log.front().bytes.substr(0, kFirstPersonBytes);  // of the form of before
  first[3] = '1';
  const std::vector<RecordedEstimate> read = parse_person_log(first + bytes, "x");
  ASSERT_EQ(read.size(), log.size() + 1);
  EXPECT_EQ(read[0].bytes, first);
  for (std::size_t k = 0; k < log.size(); ++k) {
    EXPECT_EQ(read[k + 1].bytes, log[k].bytes);
    EXPECT_NEAR(read[k + 1].at, static_cast<double>(k) / 30.0, 1e-12);
  }
  EXPECT_EQ(counts_of(read)[0], static_cast<long>(log.size()) + 1);
}

TEST(PersonLog, NamesWhatIsWrong) {
  const std::string bytes = person_log(clip_seen(Task::kWave));
  const auto refusal = [](const std::string& text) {
    return test::thrown_message<InputError>([&] { (void)parse_person_log(text, "person.dpj"); });
  };
  EXPECT_SENTENCE(refusal(""));
  EXPECT_SENTENCE(refusal("text"));
  EXPECT_SENTENCE(refusal(bytes.substr(0, 1000)));
  EXPECT_SENTENCE(refusal(bytes.substr(608, 608) + bytes.substr(0, 608)));
}

// Somebody who stands 0.9 m ahead and holds their right hand out, for 4 s.
std::vector<RecordedEstimate> hand_held_out() {
  HumanJoints joints = test::standing_adult({0.9, 0.0, 0.2});  // in the base's frame
  joints.col(kRightElbow) = Eigen::Vector3d(0.75, -0.1, 0.2);
  joints.col(kRightWrist) = Eigen::Vector3d(0.55, -0.1, 0.1);
  joints.col(kRightHand) = Eigen::Vector3d(0.45, -0.1, 0.1);
  std::vector<RecordedEstimate> log;
  for (std::uint64_t k = 0; k < 120; ++k) {
    PersonEstimate estimate{.sequence = k + 1, .stamp = static_cast<double>(k) / 30.0, .seen = true};
    for (int j = 0; j < kSmplJoints; ++j)
      estimate.joints.col(j) = seeing().camera.X_BC.inverse() * Eigen::Vector3d(joints.col(j));
    estimate.latency = 0.1;
    log.push_back(recorded(estimate));
  }
  return log;
}

// The hand of a policy that looks goes to theirs; that of one which stands does not.
TEST(SeenPerson, ThePolicyActsBesideThePersonOfTheRecording) {
  const std::vector<RecordedEstimate> log = hand_held_out();
  const SeenTask seen = see_person(log, {seeing()}, *policy("servo"), Task::kHandshake);
  ASSERT_TRUE(seen.ran) << seen.message;
  EXPECT_EQ(seen.outcome, Outcome::kOk) << seen.message;
  ASSERT_TRUE(seen.begins_at.has_value());
  EXPECT_LT(seen.nearest, 0.2);
  EXPECT_EQ(seen.unseen_ticks, 0);
  EXPECT_EQ(seen.held_ticks, 0);
  EXPECT_EQ(refused_estimates(seen.estimates), 0);
  const SeenTask still = see_person(log, {seeing()}, *policy("null"), Task::kHandshake);
  EXPECT_FALSE(still.begins_at.has_value());
  EXPECT_GT(still.nearest, 0.3);
}

TEST(SeenPerson, TheSameRecordingGivesTheSameRun) {
  const std::vector<RecordedEstimate> log = clip_seen(Task::kWave);
  const SeenTask a = see_person(log, {seeing()}, *policy("servo"), Task::kWave);
  const SeenTask b = see_person(log, {seeing()}, *policy("servo"), Task::kWave);
  EXPECT_EQ(a.nearest, b.nearest);
  EXPECT_EQ(a.begins_at, b.begins_at);
  EXPECT_EQ(a.clamps, b.clamps);
}

// Nobody for half a second, with somebody near: the guard holds until they are there again. An estimate whose depth is
// by another focal length is counted with its reason.
TEST(SeenPerson, AGapHoldsAndRefusedEstimatesAreCounted) {
  std::vector<RecordedEstimate> log;
  for (std::uint64_t k = 0; k < 120; ++k) {
    PersonEstimate estimate;
    estimate.sequence = k + 1;
    estimate.stamp = static_cast<double>(k) / 30.0;
    estimate.seen = k < 60 || k >= 75;
    const Pose X_CB = seeing().camera.X_BC.inverse();
    const HumanJoints standing = test::standing_adult({4.0, 0.0, 0.2});
    for (int j = 0; j < kSmplJoints; ++j) estimate.joints.col(j) = X_CB * Eigen::Vector3d(standing.col(j));
    if (k % 30 == 29) estimate.joints *= 24.4;
    log.push_back(recorded(estimate));
  }
  const SeenTask seen = see_person(log, {seeing(true)}, *policy("null"), Task::kWave);
  ASSERT_TRUE(seen.ran) << seen.message;
  EXPECT_EQ(seen.outcome, Outcome::kOk) << seen.message;
  EXPECT_GT(seen.held_ticks, 5);
  EXPECT_GT(seen.unseen_ticks, 5);
  EXPECT_EQ(seen.estimates[static_cast<std::size_t>(PersonFault::kFar)], 4);
  EXPECT_EQ(seen.estimates[static_cast<std::size_t>(PersonFault::kUnseen)], 15);
}

TEST(SeenPerson, WhereNothingCanBeUsedNothingRuns) {
  PersonEstimate estimate;
  estimate.seen = true;
  estimate.joints = test::standing_adult({0.0, 0.0, 55.0});
  const SeenTask seen = see_person({recorded(estimate)}, {seeing()}, *policy("null"), Task::kWave);
  EXPECT_FALSE(seen.ran);
  EXPECT_EQ(seen.message, "no estimate could be used");
  EXPECT_EQ(seen.estimates[static_cast<std::size_t>(PersonFault::kFar)], 1);
}

}  // namespace
}  // namespace duet
