// The maker's walking as the executor, with a stand-in for its service in memory.
#include "duet/hardware/executors/sport_executor.h"

#include <fmt/format.h>

#include <limits>

#include "duet/hardware/twin/fakes.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "tests/hardware/guarded_twin.h"
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

}  // namespace
}  // namespace duet
