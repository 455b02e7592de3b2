#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "duet/io/channel.h"

namespace duet {
namespace {

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
