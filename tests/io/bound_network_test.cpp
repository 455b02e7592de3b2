#include "duet/io/bound_network.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "duet/core/require.h"
#include "duet/io/channel.h"
#include "tests/backends/allocation_count.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// y = x + 1, h' = h + x[0]; its own memory counts the runs since the last reset.
class CountingNetwork final : public Network {
 public:
  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }
  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    for (std::size_t i = 0; i < 2; ++i) outputs[0][i] = inputs[0][i] + 1.0F;
    outputs[1][0] = inputs[1][0] + inputs[0][0];
    outputs[2][0] = static_cast<float>(++runs_);
  }
  void reset() override { runs_ = 0; }

 private:
  std::vector<Port> inputs_ = {{"x", 2}, {"h", 1}}, outputs_ = {{"y", 2}, {"next_h", 1}, {"runs", 1}};
  int runs_ = 0;
};

BoundNetwork counting() { return {std::make_unique<CountingNetwork>(), "mine.yaml", "net.onnx"}; }

TEST(BoundNetwork, RunsOnWhatItsInputsHoldAndFeedsItsStatesBack) {
  BoundNetwork network = counting();
  std::vector<float> x = {2.0F, 3.0F};
  network.bind_input("x", 4, x, {});
  network.bind_state("h", 5, "next_h");
  network.require_all_bound();
  const int y = network.find_output("y", 6), runs = network.find_output("runs", 6);
  for (int episode = 0; episode < 2; ++episode) {
    x[0] = 2.0F;
    network.run();
    EXPECT_THAT(network.output(y), ElementsAre(3.0F, 4.0F));
    EXPECT_THAT(network.output(1), ElementsAre(2.0F));
    x[0] = 5.0F;
    network.run();
    EXPECT_THAT(network.output(1), ElementsAre(7.0F));
    EXPECT_THAT(network.output(runs), ElementsAre(2.0F));
    network.reset();
  }
}

TEST(BoundNetwork, AllocatesNothingInRun) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer counts";
  BoundNetwork network = counting();
  const std::vector<float> x = {2.0F, 3.0F};
  network.bind_input("x", 4, x, {});
  network.bind_state("h", 5, "next_h");
  const long before = test::allocation_count();
  network.run();
  network.reset();
  EXPECT_EQ(test::allocation_count(), before);
}

TEST(BoundNetwork, RefusesInputsThatAreNotItsOwnWithTheLayout) {
  BoundNetwork network = counting();
  const std::vector<float> x = {2.0F, 3.0F, 4.0F};
  const auto bind = [&](const std::string& name, std::size_t size) {
    return thrown_message<InputError>([&] {
      network.bind_input(name, 4, std::span(x).first(size), {{{{"gyro", 3}}, 1}});
    });
  };
  EXPECT_SENTENCE(bind("x", 3));
  EXPECT_SENTENCE(bind("z", 2));
  EXPECT_SENTENCE(bind("", 2));
  EXPECT_EQ(bind("x", 2), "(nothing was thrown)");
  EXPECT_SENTENCE(bind("x", 2));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { network.require_all_bound(); }));
}

TEST(BoundNetwork, RefusesStatesThatDoNotFit) {
  BoundNetwork network = counting();
  EXPECT_SENTENCE(thrown_message<InputError>([&] { network.bind_state("h", 5, "y"); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { network.bind_state("h", 5, "next"); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)network.find_output("", 7); }));
}

TEST(JointBinding, FindsJointsByNameInTheFilesOrder) {
  RobotModel robot;
  for (const char* name : {"hip", "knee", "ankle"}) robot.joints.push_back({.name = name});
  const std::vector<std::string> all = {"ankle", "hip", "knee"};
  const JointBinding whole = bind_by_name(all, robot);
  EXPECT_THAT(whole.indices, ElementsAre(2, 0, 1));
  EXPECT_THAT(whole.absent, IsEmpty());
  EXPECT_THAT(whole.unnamed, IsEmpty());
}

TEST(JointBinding, SaysWhatEitherLacks) {
  RobotModel robot;
  for (const char* name : {"hip", "knee", "ankle"}) robot.joints.push_back({.name = name});
  const std::vector<std::string> some = {"knee", "toe", "Hip"};
  const JointBinding part = bind_by_name(some, robot);
  EXPECT_THAT(part.indices, ElementsAre(1, -1, -1));
  EXPECT_THAT(part.absent, ElementsAre("toe", "Hip"));
  EXPECT_THAT(part.unnamed, ElementsAre("hip", "ankle"));
}

constexpr double kPi = std::numbers::pi;
constexpr double kNear = 1e-12;

TEST(StandGate, StandsBelowBothBoundsAndCountsTheTicksOfWalking) {
  StandGate gate(StandBounds{.speed = 0.1, .yaw_rate = 0.2});
  const auto update = [&](double forward, double lateral, double yaw_rate) {
    gate.update(forward, lateral, yaw_rate);
    return gate.stands();
  };
  EXPECT_FALSE(update(0.1, 0.0, 0.0));  // at a bound it walks
  EXPECT_EQ(gate.walking_tick(), 0);
  EXPECT_FALSE(update(0.0, 0.0, -0.2));
  EXPECT_EQ(gate.walking_tick(), 1);
  EXPECT_TRUE(update(0.07, 0.07, 0.19));
  EXPECT_FALSE(update(0.08, -0.08, 0.0));
  EXPECT_EQ(gate.walking_tick(), 0);
  gate.reset();
  EXPECT_FALSE(update(-1.0, 0.0, 0.0));
  EXPECT_EQ(gate.walking_tick(), 0);
}

TEST(StandGate, WithoutBoundsNeverStands) {
  StandGate gate;
  gate.update(0.0, 0.0, 0.0);
  EXPECT_FALSE(gate.stands());
}

TEST(GaitClock, TurnsWithItsFrequencyFromItsPhases) {
  const GaitClock clock{.frequency_hz = 1.25, .phases = {0.5, kPi}};
  const StandGate gate;
  for (const long tick : {0L, 1L, 39L, 40L, 1000000L}) {
    const double turns = 1.25 * 0.02 * static_cast<double>(tick);
    EXPECT_NEAR(gait_angle(clock, 0, tick, gate), 2.0 * kPi * (turns - std::floor(turns)) + 0.5, kNear) << tick;
    EXPECT_NEAR(gait_angle(clock, 1, tick, gate), 2.0 * kPi * (turns - std::floor(turns)) + kPi, kNear) << tick;
  }
}

TEST(GaitClock, HoldsWhileItStandsAndStartsAgain) {
  const GaitClock clock{.frequency_hz = 1.0, .phases = {0.5}, .standing = {3.0}};
  StandGate gate(StandBounds{.speed = 0.1, .yaw_rate = 0.1});
  gate.update(0.0, 0.0, 0.0);
  EXPECT_EQ(gait_angle(clock, 0, 7, gate), 3.0);
  gate.update(1.0, 0.0, 0.0);
  EXPECT_NEAR(gait_angle(clock, 0, 8, gate), 0.5, kNear);
  gate.update(1.0, 0.0, 0.0);
  EXPECT_NEAR(gait_angle(clock, 0, 9, gate), 0.5 + 2.0 * kPi * 0.02, kNear);
  const GaitClock free{.frequency_hz = 1.0, .phases = {0.5}};
  EXPECT_NEAR(gait_angle(free, 0, 9, gate), 0.5 + 2.0 * kPi * 0.18, kNear);
}

TEST(GaitClock, TurnsBySecondsWhateverItsTicksAre) {
  const GaitClock clock{.frequency_hz = 1.25, .phases = {0.5}};
  const StandGate gate;
  for (const double period : {0.01, 0.02, 0.04})
    EXPECT_NEAR(gait_angle(clock, 0, std::lround(0.4 / period), gate, period), kPi + 0.5, kNear) << period;
}

TEST(GaitClock, TakesTheStanceForTheFirstHalfOfTheWave) {
  const StandGate gate;
  // Pairs of parts of a turn and parts of the wave.
  for (const auto& [place, wave] : {std::pair{0.0, 0.0}, std::pair{0.3, 0.25}, std::pair{0.6, 0.5},
                                    std::pair{0.8, 0.75}, std::pair{-0.2, 0.75}, std::pair{2.3, 0.25}}) {
    const GaitClock clock{.frequency_hz = 1.0, .phases = {2.0 * kPi * place}, .standing = {}, .stance = 0.6};
    EXPECT_NEAR(gait_angle(clock, 0, 0, gate), 2.0 * kPi * wave, 1e-9) << place;
  }
}

}  // namespace
}  // namespace duet
