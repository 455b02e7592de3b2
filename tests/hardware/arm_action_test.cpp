// The maker's preset arm actions: what is told, what the stand-in answers and plays, and the executor that is their
// user.
#include "duet/hardware/executors/arm_action.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "duet/hardware/executors/sport_executor.h"
#include "duet/hardware/twin/fake_arms.h"
#include "tests/hardware/limited_robot.h"
#include "tests/hardware/memory_sport.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kDt = 0.005;

JointCommand standing_stance() { return test::g1()->default_command(test::g1()->neutral); }

// The stand-ins of the walking and of the arm actions, as `duet-g1-services --sport` has them, and their client.
class MakersServices final : public test::MemorySport {
 public:
  int arm_writers() override { return 1; }
  void open_arms() override { opened = true; }
  void close_arms() override {}
  bool write_arms(const LowCommandFrame&) override { return opened = true; }

  void step() {
    now += kDt;
    LowCommandFrame frame;
    if (arms.write_arms(5, now, frame)) walking.obey_arms(frame);
    walking.write_command(5, motors);
  }
  std::int32_t tell(int action) { return arms.answer(action_request(1, action), now, walking.fsm()).code; }
  // Largest distance of an arm's target from the stance [rad].
  [[nodiscard]] double moved() const {
    double most = 0.0;
    for (int j = 15; j < kG1Motors; ++j)
      most = std::max(most, std::abs(motors.motor[j].q - standing_stance().q_target[j]));
    return most;
  }
  void go_on(double seconds) {
    for (double left = seconds; left > 0.5 * kDt; left -= kDt) step();
  }

  bool opened = false;
  FakeSport walking{standing_stance()};
  FakeArms arms{test::g1()};
  LowCommandFrame motors{};

 private:
  std::optional<RpcResponse> answer(const RpcRequest& request) override {
    const bool arm = service_of(request.call) == Service::kArm;
    return arm ? arms.answer(request, now, walking.fsm()) : walking.answer(request, now);
  }
};

TEST(ArmAction, HasTheMakersNumbersAndNames) {
  EXPECT_EQ(arm_preset("shake hand").id, 27);
  EXPECT_EQ(arm_preset(19)->task, Task::kHug);
  EXPECT_EQ(arm_preset(99), nullptr);
  EXPECT_STREQ(action_request(4, 27).parameter.data(), R"({"data":27})");
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)arm_preset("shake hands"); }));
}

TEST(FakeArms, PlaysAnActionByTheClockAndEnds) {
  for (const ArmPreset& preset : kArmPresets) {
    MakersServices makers;
    EXPECT_EQ(makers.tell(preset.id), 0);
    makers.go_on(1.0);
    EXPECT_GT(makers.moved(), 0.3) << preset.name;
    EXPECT_EQ(makers.arms.action(), preset.id);
    makers.go_on(preset.lasts);
    EXPECT_EQ(makers.arms.action(), 0) << preset.name;
    EXPECT_LT(makers.moved(), 0.02) << preset.name;
    EXPECT_EQ(makers.walking.refused(), 0);
  }
}

// No target jumps, whether it ends by itself or is released in the middle.
TEST(FakeArms, ItsTargetsDoNotJump) {
  for (const ArmPreset& preset : kArmPresets)
    for (const double released : {0.4, 2.3, 100.0}) {
      MakersServices makers;
      makers.step();
      (void)makers.tell(preset.id);
      LowCommandFrame before = makers.motors;
      for (double time = 0.0; time < 22.0; time += kDt) {
        if (std::abs(time - released) < 0.5 * kDt) {
          EXPECT_EQ(makers.tell(kReleaseArm), 0);
        }
        makers.step();
        for (int j = 15; j < kG1Motors; ++j)
          ASSERT_LT(std::abs(makers.motors.motor[j].q - before.motor[j].q), 0.3) << preset.name << time << " " << j;
        before = makers.motors;
        if (time > released + 1.1) {
          ASSERT_LT(makers.moved(), 1e-6) << preset.name;
        }
      }
    }
}

TEST(FakeArms, RefusesAsTheMakersServiceDoes) {
  MakersServices makers;
  EXPECT_EQ(makers.tell(17), kUnknownAction);  // "clap" is the maker's, and none of ours
  EXPECT_EQ(makers.tell(kReleaseArm), 0);
  EXPECT_EQ(makers.tell(27), 0);
  makers.go_on(2.0);
  EXPECT_EQ(makers.tell(27), 0);
  EXPECT_EQ(makers.tell(19), kArmsHeld);
  EXPECT_EQ(makers.arms.action(), 27);
  EXPECT_EQ(makers.tell(kReleaseArm), 0);
  makers.go_on(1.1);
  EXPECT_EQ(makers.tell(19), 0);
  MakersServices occupied;
  occupied.now = 1.0;
  occupied.arms.see_others(1.0);
  EXPECT_EQ(occupied.tell(27), kArmsOccupied);
  occupied.now = 2.0;
  EXPECT_EQ(occupied.tell(27), 0);
  EXPECT_EQ(occupied.arms.answer(action_request(1, 27), 2.0, kFsmDamp).code, kNotWalking);
  RpcRequest nothing = action_request(1, 27);
  nothing.parameter[0] = '[';
  EXPECT_NE(occupied.arms.answer(nothing, 2.0, kFsmStart).code, 0);
  EXPECT_NE(occupied.arms.answer(read_request(1, ServiceCall::kGetFsm), 2.0, kFsmStart).code, 0);
  const auto list =
      nlohmann::json::parse(occupied.arms.answer(read_request(1, ServiceCall::kListArmActions), 2.0, kFsmStart).data);
  EXPECT_EQ(list.size(), kArmPresets.size());
}

// Told once when the guard begins to run, released when it holds or damps, whatever the planner says of the arms.
TEST(VendorArmAction, BeginsWithTheRunAndIsReleasedByAHold) {
  MakersServices makers;
  SportExecutor executor(makers, kDt, arm_preset("high five").id);
  executor.open();
  const auto run_for = [&](double seconds, SafetyState state) {
    LowCommandFrame frame{};
    for (int j = 0; j < kG1Motors; ++j) frame.motor[j] = {1, 0.5f, 0.0f, 0.0f, 60.0f, 1.5f, 0};
    for (double left = seconds; left > 0.5 * kDt; left -= kDt) {
      executor.enter(state);
      EXPECT_TRUE(executor.write(frame));
      executor.send({});
      executor.poll(makers.now);
      makers.step();
    }
  };
  const auto told = [&] {
    return std::ranges::count_if(makers.requests,
                                 [](const RpcRequest& r) { return service_of(r.call) == Service::kArm; });
  };
  run_for(2.0, SafetyState::kStand);
  EXPECT_EQ(told(), 0);
  EXPECT_LT(makers.moved(), 1e-6);
  run_for(2.0, SafetyState::kRun);
  EXPECT_EQ(told(), 1);
  EXPECT_EQ(makers.arms.action(), 18);
  EXPECT_GT(makers.moved(), 0.3);
  run_for(1.5, SafetyState::kHold);
  EXPECT_EQ(told(), 2);
  EXPECT_LT(makers.moved(), 1e-6);
  run_for(1.0, SafetyState::kRun);
  EXPECT_EQ(makers.arms.action(), 18);
  executor.close();
  makers.go_on(1.5);
  EXPECT_LT(makers.moved(), 1e-6);
  EXPECT_FALSE(makers.opened) << "the arm topic is the maker's";
  EXPECT_EQ(executor.foreign_writers(0), 0);
  EXPECT_EQ(executor.complaint(), "");
}

}  // namespace
}  // namespace duet
