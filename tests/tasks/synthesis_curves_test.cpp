#include <gtest/gtest.h>

#include <cmath>

#include "duet/tasks/synthesis/act.h"
#include "duet/tasks/synthesis/curves.h"
#include "tests/support.h"

namespace duet::synthesis {
namespace {

using Curve = double (*)(double);

// Second derivative by central differences: truncation h^2, rounding epsilon / h^2.
double acceleration(Curve f, double u, double h) { return (f(u + h) - 2.0 * f(u) + f(u - h)) / (h * h); }

TEST(SynthesisCurves, StartAndEndAtRest) {
  for (const Curve f : {Curve(ramp), Curve(glide), Curve(pulse)}) {
    for (const double u : {0.0, 1.0}) {
      EXPECT_NEAR((f(u + 1e-4) - f(u - 1e-4)) / 2e-4, 0.0, 1e-6);
      EXPECT_NEAR(acceleration(f, u, 1e-4), 0.0, 1e-2);
    }
    EXPECT_NEAR(f(-3.0), f(0.0), 1e-15);
    EXPECT_NEAR(f(7.0), f(1.0), 1e-15);
  }
  EXPECT_NEAR(ramp(0.0), 0.0, 1e-15);
  EXPECT_NEAR(ramp(1.0), 1.0, 1e-15);
  EXPECT_NEAR(glide(0.0), 0.0, 1e-15);
  EXPECT_NEAR(glide(1.0), 1.0, 1e-15);
  EXPECT_NEAR(pulse(0.0), 0.0, 1e-15);
  EXPECT_NEAR(pulse(0.5), 1.0, 1e-15);
  EXPECT_NEAR(pulse(1.0), 0.0, 1e-15);
}

TEST(SynthesisCurves, RiseSteadilyToTheirPeakRates) {
  double ramp_peak = 0.0, glide_peak = 0.0;
  for (int i = 0; i < 1000; ++i) {
    const double u = i / 1000.0;
    const double ramped = ramp(u + 1e-3) - ramp(u), glided = glide(u + 1e-3) - glide(u);
    EXPECT_GE(ramped, 0.0);
    EXPECT_GE(glided, 0.0);
    ramp_peak = std::max(ramp_peak, ramped * 1e3);
    glide_peak = std::max(glide_peak, glided * 1e3);
  }
  EXPECT_NEAR(ramp_peak, 1.875, 1e-5);
  EXPECT_NEAR(glide_peak, kGlidePeak, 1e-5);
}

TEST(SynthesisChannel, KeepsValuesBetweenMoves) {
  Channel channel(2.0);
  channel.to(1.0, 2.0, 5.0);
  channel.to(4.0, 5.0, -1.0);
  EXPECT_EQ(channel.at(0.0), 2.0);
  EXPECT_NEAR(channel.at(1.5), 3.5, 1e-12);
  EXPECT_EQ(channel.at(3.0), 5.0);
  EXPECT_NEAR(channel.at(4.5), 2.0, 1e-12);
  EXPECT_EQ(channel.at(99.0), -1.0);
}

TEST(SynthesisChannel, RefusesOverlappingAndEmptyMoves) {
  Channel channel;
  channel.to(1.0, 2.0, 5.0);
  const auto overlap = [&] { channel.to(1.5, 3.0, 0.0); };
  const auto empty = [&] { channel.to(3.0, 3.0, 0.0); };
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(overlap));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(empty));
}

TEST(SynthesisSway, StaysSmallSlowAndRepeatable) {
  const Sway sway(Random(1, 2)), same(Random(1, 2)), other(Random(1, 3));
  double difference = 0.0;
  for (int i = 0; i < 5000; ++i) {
    const double t = 0.02 * i;
    EXPECT_LE(std::abs(sway.at(t)), 1.0);
    EXPECT_LT(std::abs(sway.at(t + 0.02) - sway.at(t)), 0.02 * 2.0 * 3.1416 * 0.4);
    EXPECT_EQ(sway.at(t), same.at(t));
    difference = std::max(difference, std::abs(sway.at(t) - other.at(t)));
  }
  EXPECT_GT(difference, 0.1);
}

TEST(SynthesisBurst, IsZeroOutsideAndBoundedInside) {
  const Burst burst{1.0, 3.0, 2.0, 0.3};
  EXPECT_EQ(burst.at(0.5), 0.0);
  EXPECT_EQ(burst.at(3.5), 0.0);
  double most = 0.0;
  for (int i = 0; i < 400; ++i) most = std::max(most, std::abs(burst.at(0.01 * i)));
  EXPECT_GT(most, 0.95);
  EXPECT_LE(most, 1.0);
}

TEST(SynthesisBurst, SwingsAtItsRate) {
  for (const double rate : {1.0, 2.5}) {
    const Burst burst{1.0, 5.0, rate, 0.3};
    for (double t = 1.5; t < 4.0; t += 1.0 / rate) {
      EXPECT_NEAR(burst.at(t + 1.0 / rate), burst.at(t), 1e-9);
      EXPECT_NEAR(burst.at(t + 0.5 / rate), -burst.at(t), 1e-9);
    }
    EXPECT_NEAR(burst.at(1.0 + 2.25 / rate), 1.0, 1e-9);
  }
}

TEST(SynthesisDraws, SpreadGoesThroughItsDeciles) {
  const Deciles deciles{.low = 1.0, .middle = 2.0, .high = 6.0};
  for (int index = 0; index < 500; ++index) {
    Draws draws(7, Task::kHug, index);
    const double u = draws.stream("distance").uniform(), value = draws.spread("distance", deciles);
    EXPECT_EQ(value <= deciles.low, u <= 0.1) << u;
    EXPECT_EQ(value <= deciles.middle, u <= 0.5) << u;
    EXPECT_EQ(value <= deciles.high, u <= 0.9) << u;
    EXPECT_GE(value, deciles.low - 0.25) << u << ": a quarter of the last stretch at most";
    EXPECT_LE(value, deciles.high + 1.0) << u;
  }
}

TEST(SynthesisDraws, WhatFollowsTheStyleIsWithinAFifthOfTheRange) {
  for (int index = 0; index < 100; ++index)
    for (const double style : {0.0, 0.3, 1.0}) {
      Draws draws(7, Task::kHug, index);
      const double share = (draws.styled("speed", style, 2.0, 4.0) - 2.0) / 2.0;
      EXPECT_NEAR(share, style, 0.2 + 1e-12);
      EXPECT_GE(share, 0.0);
      EXPECT_LE(share, 1.0);
    }
}

}  // namespace
}  // namespace duet::synthesis
