#include "duet/hardware/log/guard_health.h"

#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/require.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;
using ::testing::HasSubstr;

TEST(GuardHealth, HasAgesOfWhatCameAndNoneOfWhatDidNot) {
  GuardedTwin robot;
  robot.start();
  robot.plans = false;
  robot.run_for(0.2);
  GuardHealth health;
  fill_health(robot.guard, health);
  EXPECT_EQ(health.state, SafetyState::kRun);
  EXPECT_TRUE(health.stands);
  EXPECT_EQ(health.state_age, 0.0);
  EXPECT_NEAR(health.planner_age, 0.2, 0.02 + 1e-9);
  EXPECT_TRUE(std::isnan(health.executor_age));
  EXPECT_TRUE(std::isnan(health.charge));  // nobody reports it
  EXPECT_EQ(health.states, robot.guard.status().states);
}

TEST(GuardHealth, AWindowKeepsTheOldestTheNearestAndTheHottest) {
  GuardHealth window, first, second;
  first.time = 1.0, first.state_age = 0.03, first.distance = 0.4, first.casing = 60.0, first.share = 0.2;
  second.time = 2.0, second.state_age = 0.01, second.distance = 0.9, second.casing = 50.0, second.share = 1.0;
  second.states = 7;
  widen(first, window);
  EXPECT_EQ(window.share, 0.2);
  widen(second, window);
  EXPECT_EQ(window.time, 2.0);
  EXPECT_EQ(window.state_age, 0.03);
  EXPECT_EQ(window.distance, 0.4);
  EXPECT_EQ(window.casing, 60.0);
  EXPECT_EQ(window.share, 0.2);
  EXPECT_EQ(window.states, 7);
  EXPECT_TRUE(std::isnan(window.person_age));
}

TEST(GuardHealth, IsReadAsItWasWritten) {
  HealthMessage message;
  message.health.state = SafetyState::kHold;
  message.health.cause = StopCause::kPlannerAge;
  message.health.stands = true;
  message.health.planner_age = 0.7;
  message.health.distance = 0.456;
  message.health.restarts = 3;
  message.health.network = {5, 0, 0, 0, 7};
  message.missing = "remote_age";
  message.tracking_joint = "left_elbow_joint";
  message.next = std::string(next_key(SafetyState::kHold, true));
  const HealthMessage again = parse_health(health_json(message).dump(), "status");
  EXPECT_EQ(health_json(again), health_json(message));
  EXPECT_TRUE(std::isnan(again.health.charge));
  const std::string text = health_text(again);
  EXPECT_THAT(text, HasSubstr("hold (planner_age), missing: remote_age"));
  EXPECT_THAT(text, HasSubstr("next: A with R1: run again; select: damp"));
  EXPECT_THAT(text, HasSubstr("planner 700 ms, person never"));
  EXPECT_THAT(text, HasSubstr("charge not known"));
  EXPECT_THAT(text, HasSubstr("person: 0.46 m away; "));
  EXPECT_EQ(again.health.network, message.health.network);
  EXPECT_THAT(text, HasSubstr("network: 5 taken, 7 refused: 7 forged (another key, or altered on its way)"));
}

TEST(GuardHealth, RefusesWhatIsNoHealth) {
  const auto refusal = [](const std::string& text) {
    return test::thrown_message<InputError>([&] { (void)parse_health(text, "status"); });
  };
  EXPECT_SENTENCE(refusal("{"));
  EXPECT_SENTENCE(refusal("[]"));
  nlohmann::json json = health_json({});
  json["state"] = "asleep";
  EXPECT_SENTENCE(refusal(json.dump()));
  json = health_json({});
  json["charge"] = "full";
  EXPECT_SENTENCE(refusal(json.dump()));
  json = health_json({});
  json.erase("restarts");
  EXPECT_SENTENCE(refusal(json.dump()));
  json = health_json({});
  for (const char* count : {"-1", "1e300", "18446744073709551615"}) {
    json["restarts"] = nlohmann::json::parse(count);
    EXPECT_SENTENCE(refusal(json.dump()));
  }
}

// Each state has a key, or says what is waited for; what the guard does with them is tested by the guard's own tests.
TEST(GuardHealth, EveryStateHasANextKey) {
  for (int state = 0; state < kSafetyStates; ++state)
    for (const bool stands : {false, true})
      EXPECT_FALSE(next_key(static_cast<SafetyState>(state), stands).empty()) << state;
  GuardedTwin robot;
  robot.hold_key(RemoteKey::kR1);
  robot.run_for(2.2);
  EXPECT_EQ(robot.state(), SafetyState::kReady);
  robot.guard.arm();
  robot.tick();
  EXPECT_THAT(std::string(next_key(robot.state(), false)), HasSubstr("start: stand up"));
  robot.hold_key(RemoteKey::kStart);
  robot.run_for(0.1);
  robot.drop_key(RemoteKey::kStart);
  robot.run_for(1.0);
  ASSERT_TRUE(robot.guard.status().input.stands);
  EXPECT_THAT(std::string(next_key(robot.state(), true)), HasSubstr("A with R1: run"));
  robot.hold_key(RemoteKey::kA);
  robot.run_for(0.1);
  EXPECT_EQ(robot.state(), SafetyState::kRun);
}

}  // namespace
}  // namespace duet
