// The maker's walking as the executor, with a stand-in for its service in memory.
#include "duet/hardware/executors/sport_executor.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "duet/hardware/executors/arm_action.h"
#include "duet/hardware/twin/fake_arms.h"
#include "duet/hardware/twin/fakes.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/hardware/limited_robot.h"
#include "tests/hardware/memory_sport.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kDt = 0.002;

class SportAlone final : public test::MemorySport {
 public:
  explicit SportAlone(FakeSport& service) : service_(service) {}
  int arm_writers() override { return others; }
  void open_arms() override { open = true; }
  void close_arms() override { open = false; }
  bool write_arms(const LowCommandFrame& frame) override {
    EXPECT_TRUE(open);
    frames.push_back(frame);
    service_.obey_arms(frame);
    return true;
  }
  [[nodiscard]] long asked(ServiceCall call) const {
    return std::ranges::count_if(requests, [call](const RpcRequest& r) { return r.call == call; });
  }

  int others = 0;
  bool open = false, alive = true;
  std::vector<LowCommandFrame> frames;

 private:
  std::optional<RpcResponse> answer(const RpcRequest& request) override {
    return alive ? std::optional(service_.answer(request, now)) : std::nullopt;
  }

  FakeSport& service_;
};

JointCommand neutral_stance() { return test::g1()->default_command(test::g1()->neutral); }

LowCommandFrame targets(float q) {
  LowCommandFrame frame{};
  frame.mode_machine = 5;
  for (int j = 0; j < kG1Motors; ++j) frame.motor[j] = {1, q, 0.0f, 0.0f, 60.0f, 1.5f, 0};
  return frame;
}

struct SportTrial {
  void tick(const LowCommandFrame& frame, const VelocityCommand& velocity, SafetyState state) {
    wire.now += kDt;
    executor.enter(state);
    executor.write(frame);
    executor.send(velocity);
    executor.poll(wire.now);
  }
  void run_for(double seconds, const LowCommandFrame& frame, const VelocityCommand& velocity, SafetyState state) {
    for (double left = seconds; left > 0.5 * kDt; left -= kDt) tick(frame, velocity, state);
  }

  FakeSport service{neutral_stance()};
  SportAlone wire{service};
  SportExecutor executor{wire, kDt};
};

TEST(SportExecutor, AsksNothingButItsStateBeforeItIsOpened) {
  SportTrial trial;
  trial.run_for(1.0, targets(0.1f), {0.2, 0.0, 0.0, 0.74}, SafetyState::kReady);
  EXPECT_EQ(trial.wire.asked(ServiceCall::kGetFsm), static_cast<long>(trial.wire.requests.size()));
  EXPECT_NEAR(static_cast<double>(trial.wire.requests.size()), 10.0, 1.0);
  EXPECT_TRUE(trial.wire.frames.empty());
  EXPECT_NEAR(trial.executor.heard_at(), trial.wire.now, 0.15);
  EXPECT_EQ(trial.executor.complaint(), "");
}

TEST(SportExecutor, AMachineThatAnswersAndDoesNotWalkIsNotHeard) {
  FakeSport damped(neutral_stance(), 1);
  SportAlone wire(damped);
  SportExecutor executor(wire, kDt);
  for (; wire.now < 1.0; wire.now += kDt) executor.poll(wire.now);
  EXPECT_GT(wire.asked(ServiceCall::kGetFsm), 5);
  EXPECT_EQ(executor.heard_at(), kNever);
}

TEST(SportExecutor, AVelocityEndsByItselfWhenNobodyRenewsIt) {
  SportTrial trial;
  trial.executor.open();
  trial.run_for(1.0, targets(0.1f), {0.2, 0.0, -0.1, 0.74}, SafetyState::kRun);
  EXPECT_NEAR(static_cast<double>(trial.wire.asked(ServiceCall::kSetVelocity)), 10.0, 1.0);
  EXPECT_NEAR(trial.service.velocity(trial.wire.now).forward, 0.2, 1e-4);
  EXPECT_NEAR(trial.service.velocity(trial.wire.now).yaw_rate, -0.1, 1e-4);
  EXPECT_EQ(trial.service.velocity(trial.wire.now + 0.31).forward, 0.0);  // the guard has died
}

TEST(SportExecutor, ComingToRestIsToldAtOnce) {
  SportTrial trial;
  trial.executor.open();
  trial.run_for(0.5, targets(0.1f), {0.2, 0.0, 0.0, 0.74}, SafetyState::kRun);
  trial.tick(targets(0.1f), {0.0, 0.0, 0.0, 0.74}, SafetyState::kHold);
  EXPECT_EQ(trial.service.velocity(trial.wire.now).forward, 0.0);
}

TEST(SportExecutor, ArmsAloneAreToldFiftyTimesASecondAndTheirWeightRisesSlowly) {
  SportTrial trial;
  trial.executor.open();
  trial.run_for(1.0, targets(0.1f), {}, SafetyState::kStand);
  EXPECT_NEAR(static_cast<double>(trial.wire.frames.size()), 50.0, 1.0);
  const LowCommandFrame& last = trial.wire.frames.back();
  EXPECT_NEAR(last.motor[29].q, 0.2, 0.01);
  EXPECT_EQ(last.crc, checksum_of(last));
  for (int j = 0; j < 15; ++j) EXPECT_EQ(last.motor[j].mode, 0) << j;  // neither legs nor waist
  for (int j = 15; j < kG1Motors; ++j) EXPECT_FLOAT_EQ(last.motor[j].q, 0.1f) << j;
  trial.run_for(5.0, targets(0.1f), {}, SafetyState::kRun);
  EXPECT_EQ(trial.executor.arm_weight(), 1.0);
  EXPECT_EQ(trial.service.refused(), 0);
}

TEST(SportExecutor, DampingAsksTheServiceToDampUntilItDoes) {
  SportTrial trial;
  trial.executor.open();
  LowCommandFrame damping{};
  trial.run_for(1.0, damping, {}, SafetyState::kArmed);
  trial.run_for(1.0, damping, {}, SafetyState::kDamp);
  EXPECT_EQ(trial.service.fsm(), kFsmStart);  // nothing has moved: its balance is left alone
  trial.run_for(5.5, targets(0.1f), {}, SafetyState::kRun);
  trial.run_for(0.5, damping, {}, SafetyState::kDamp);
  EXPECT_EQ(trial.service.fsm(), kFsmDamp);
  const long asked = trial.wire.asked(ServiceCall::kSetFsm);
  trial.run_for(4.7, damping, {}, SafetyState::kDamp);
  EXPECT_EQ(trial.wire.asked(ServiceCall::kSetFsm), asked);
  EXPECT_NEAR(trial.executor.arm_weight(), 0.0, 1e-9);  // gone with the five seconds of damping
  EXPECT_SENTENCE(trial.executor.complaint());
}

TEST(SportExecutor, SaysThatTheServiceIsSilentOrRefuses) {
  SportTrial trial;
  trial.wire.alive = false;
  trial.executor.poll(1.0);
  EXPECT_EQ(trial.executor.heard_at(), kNever);
  EXPECT_SENTENCE(trial.executor.complaint());
  EXPECT_EQ(trial.executor.foreign_writers(3), 0);  // the low-level topic is the maker's
  trial.wire.others = 1;
  EXPECT_EQ(trial.executor.foreign_writers(0), 1);
}

TEST(SportExecutor, ClosingStopsAndLeavesTheArms) {
  SportTrial trial;
  trial.executor.open();
  trial.run_for(0.5, targets(0.1f), {0.2, 0.0, 0.0, 0.74}, SafetyState::kRun);
  trial.executor.close();
  EXPECT_EQ(trial.service.velocity(trial.wire.now).forward, 0.0);
  EXPECT_FALSE(trial.wire.open);
}

TEST(FakeSport, RefusesFramesAndCallsThatAreWrong) {
  FakeSport service(neutral_stance());
  LowCommandFrame frame = targets(0.1f);
  service.obey_arms(frame);
  EXPECT_EQ(service.refused(), 1);  // no checksum
  RpcRequest request = velocity_request(7, {0.1, 0.0, 0.0, 0.0}, 0.3);
  request.parameter[0] = '[';
  EXPECT_NE(service.answer(request, 0.0).code, 0);
  request.call = static_cast<ServiceCall>(1234);
  EXPECT_NE(service.answer(request, 0.0).code, 0);
  EXPECT_EQ(service.answer(read_request(9, ServiceCall::kGetFsm), 0.0).id, 9);
}

TEST(FakeSwitcher, SaysWhichModeRunsAndReleasesIt) {
  FakeSwitcher debug, walking("ai");
  const RpcRequest check = read_request(3, ServiceCall::kCheckMode);
  EXPECT_EQ(debug.answer(check).data, R"({"form":"0","name":""})");
  EXPECT_EQ(walking.answer(check).data, R"({"form":"0","name":"ai"})");
  EXPECT_EQ(walking.answer(check).id, 3);
  EXPECT_EQ(walking.answer(read_request(4, ServiceCall::kReleaseMode)).code, 0);
  EXPECT_EQ(walking.answer(check).data, R"({"form":"0","name":""})");
  EXPECT_FALSE(walking.runs());
  const auto select = [](std::string_view name) {
    RpcRequest request = read_request(5, ServiceCall::kSelectMode);
    fmt::format_to_n(request.parameter.data(), request.parameter.size() - 1, R"({{"name":"{}"}})", name);
    return request;
  };
  EXPECT_NE(walking.answer(select("normal")).code, 0);
  EXPECT_NE(walking.answer(read_request(6, ServiceCall::kSelectMode)).code, 0);
  EXPECT_FALSE(walking.runs());
  EXPECT_EQ(walking.answer(select("ai")).code, 0);
  EXPECT_TRUE(walking.runs());
  EXPECT_NE(debug.answer(select("")).code, 0);
  EXPECT_NE(debug.answer(read_request(7, ServiceCall::kGetFsm)).code, 0);
}

// A robot whose motion_switcher answers.
class SwitcherWire final : public test::MemorySport {
 public:
  std::optional<FakeSwitcher> switcher;

 private:
  std::optional<RpcResponse> answer(const RpcRequest& request) override {
    return switcher ? std::optional(switcher->answer(request)) : std::nullopt;
  }
  int arm_writers() override { return 0; }
  void open_arms() override {}
  void close_arms() override {}
  bool write_arms(const LowCommandFrame&) override { return false; }
};

TEST(ModeWatch, AsksOnceASecondWhichModeRunsAndNothingElse) {
  SwitcherWire wire;
  ModeWatch watch(wire);
  auto poll_for = [&, now = 10.0](double seconds) mutable {
    for (const double end = now + seconds; now < end; now += 0.002) watch.poll(now);
  };
  poll_for(3.0);
  EXPECT_FALSE(watch.mode()) << "nobody answers";
  wire.switcher.emplace("ai");
  poll_for(1.1);
  EXPECT_EQ(watch.mode(), "ai");
  (void)wire.switcher->answer(read_request(9, ServiceCall::kReleaseMode));
  poll_for(1.1);
  EXPECT_EQ(watch.mode(), "");
  EXPECT_LE(wire.requests.size(), 6U);
  for (const RpcRequest& request : wire.requests) EXPECT_EQ(request.call, ServiceCall::kCheckMode);
}

TEST(SportRpc, WritesTheParametersThatTheMakersClientWrites) {
  EXPECT_STREQ(velocity_request(1, {0.2, -0.1, 0.05, 0.74}, 0.3).parameter.data(),
               R"({"velocity":[0.2000,-0.1000,0.0500],"duration":0.30})");
  EXPECT_STREQ(fsm_request(2, 1).parameter.data(), R"({"data":1})");
  EXPECT_STREQ(read_request(3, ServiceCall::kGetFsm).parameter.data(), "");
}

TEST(SportRpc, NoVelocityLastsLongerThanHalfASecondAndNoneIsNotANumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const double asked : {-1.0, 0.0, 0.2, 864000.0, nan, inf}) {
    const auto order =
        order_of(ServiceCall::kSetVelocity, velocity_request(1, {nan, inf, 1e30, 0.0}, asked).parameter.data());
    ASSERT_TRUE(order) << asked;
    EXPECT_GE(order->duration, 0.1) << asked;
    EXPECT_LE(order->duration, 0.5) << asked;
    EXPECT_EQ(order->velocity.forward, 0.0);
    EXPECT_EQ(order->velocity.yaw_rate, 10.0);
  }
}

TEST(SportRpc, ReadsAnswersAndNothingElse) {
  EXPECT_EQ(fsm_of(R"({"data":500})"), 500);
  for (const char* wrong :
       {"", "500", "[]", "{}", R"({"data":"500"})", R"({"data":1e99})", R"({"data":0.5})", "{\"data\":"})
    EXPECT_FALSE(fsm_of(wrong)) << wrong;
  std::string long_one(5000, ' ');
  long_one += R"({"data":1})";
  EXPECT_FALSE(fsm_of(long_one));
  for (const char* wrong : {"", R"({"velocity":[1,2],"duration":1})", R"({"velocity":[1,2,"x"],"duration":1})",
                            R"({"velocity":[1,2,3]})", R"({"velocity":{},"duration":1})"})
    EXPECT_FALSE(order_of(ServiceCall::kSetVelocity, wrong)) << wrong;
  EXPECT_FALSE(order_of(ServiceCall::kGetFsm, R"({"data":1})"));
}

// The maker's preset arm actions: what is told, what the stand-in answers and plays, and the executor that is their
// user.

constexpr double kServiceDt = 0.005;

JointCommand standing_stance() { return test::g1()->default_command(test::g1()->neutral); }

// The stand-ins of the walking and of the arm actions, as `duet-g1-services --sport` has them, and their client.
class MakersServices final : public test::MemorySport {
 public:
  int arm_writers() override { return 1; }
  void open_arms() override { opened = true; }
  void close_arms() override {}
  bool write_arms(const LowCommandFrame&) override { return opened = true; }

  void step() {
    now += kServiceDt;
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
    for (double left = seconds; left > 0.5 * kServiceDt; left -= kServiceDt) step();
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
      for (double time = 0.0; time < 22.0; time += kServiceDt) {
        if (std::abs(time - released) < 0.5 * kServiceDt) {
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
  SportExecutor executor(makers, kServiceDt, arm_preset("high five").id);
  executor.open();
  const auto run_for = [&](double seconds, SafetyState state) {
    LowCommandFrame frame{};
    for (int j = 0; j < kG1Motors; ++j) frame.motor[j] = {1, 0.5f, 0.0f, 0.0f, 60.0f, 1.5f, 0};
    for (double left = seconds; left > 0.5 * kServiceDt; left -= kServiceDt) {
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
