// Forces over time against their limits: closed forms, spans, sums, steps, pressure.
#include "duet/metrics/contact_safety.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "tests/metrics/contact_scene.h"

namespace duet {
namespace {

using Eigen::Vector3d;
using test::contact_table;
using test::ContactsAt;
using test::fed;
using test::kChestA;
using test::kChestB;
using test::kFoot;
using test::kHandLeft;
using test::kHead;
using test::kRounding;
using test::pulse;
using test::region;
using test::touch;

TEST(ContactSafety, AConstantForceHasItsClosedForm) {
  const ContactSafetyResult result = fed(2.0, pulse(kChestA, 50.0, 0.5, 1.5));
  const RegionContact& chest = region(result, "chest");
  EXPECT_EQ(chest.peak_force, 50.0);
  EXPECT_EQ(chest.peak_pair_force, 50.0);
  EXPECT_EQ(chest.quasi_static_force, 50.0);
  EXPECT_EQ(chest.transient_force, 50.0);
  EXPECT_EQ(chest.windowed_mean, 50.0);
  EXPECT_NEAR(chest.impulse, 50.0, kRounding);
  EXPECT_NEAR(chest.longest, 1.0, kRounding);
  EXPECT_EQ(chest.contacts, 1);
  EXPECT_EQ(chest.transient_contacts, 0);
  EXPECT_NEAR(*chest.quasi_static_ratio, 50.0 / 140.0, kRounding);
  EXPECT_NEAR(*chest.transient_ratio, 50.0 / 280.0, kRounding);
  EXPECT_EQ(chest.worst_ratio, chest.quasi_static_ratio);
  EXPECT_EQ(chest.verdict, ContactFinding::kWithin);
  EXPECT_EQ(result.peak_force, 50.0);
  EXPECT_EQ(result.quasi_static_force, 50.0);
  EXPECT_NEAR(result.duration, 2.0, kRounding);

  ASSERT_EQ(result.events.size(), 1u);
  const ContactEvent& event = result.events[0];
  EXPECT_EQ(event.link, 0);
  EXPECT_EQ(event.capsule, kChestA);
  EXPECT_EQ(result.regions[event.region].region, "chest");
  EXPECT_NEAR(event.begin_s, 0.5, kRounding);
  EXPECT_NEAR(event.duration_s, 1.0, kRounding);
  EXPECT_EQ(event.peak_n, 50.0);
  EXPECT_NEAR(event.impulse_ns, 50.0, kRounding);
  EXPECT_EQ(event.windowed_mean_n, 50.0);
}

TEST(ContactSafety, AHalfSineHasItsClosedForm) {
  constexpr double kLength = 2.0, kPeak = 100.0, kPi = std::numbers::pi;
  const auto half_sine = [](double t) {
    return std::vector{touch(kChestA, t < kLength ? kPeak * std::sin(kPi * t / kLength) : 0.0)};
  };
  for (const double dt : {0.001, 0.002}) {
    const ContactSafetyResult result = fed(2.5, half_sine, dt);
    const RegionContact& chest = region(result, "chest");
    const double slope = kPeak * kPi / kLength;  // the steepest [N/s]
    EXPECT_NEAR(chest.peak_force, kPeak, slope * dt);
    EXPECT_NEAR(chest.impulse, kPeak * 2.0 * kLength / kPi, slope * dt);
    // The level held for 0.5 s around the peak; the mean over 20 ms may look 10 ms further in, and a step more.
    EXPECT_NEAR(chest.quasi_static_force, kPeak * std::cos(kPi * 0.25 / kLength), slope * (0.01 + dt));
    EXPECT_GE(chest.quasi_static_force, kPeak * std::cos(kPi * 0.25 / kLength) - slope * dt);
    EXPECT_NEAR(chest.transient_force, kPeak * std::sin(kPi * 0.5 / kLength), slope * dt);
    const double angle = kPi * 0.05 / kLength;  // of half the window of the mean
    EXPECT_NEAR(chest.windowed_mean, kPeak * std::sin(angle) / angle, slope * dt);
    EXPECT_NEAR(chest.longest, kLength, dt);
  }
}

TEST(ContactSafety, AShortPulseIsTransientOnly) {
  const ContactSafetyResult result = fed(1.5, pulse(kChestA, 200.0, 0.2, 0.6));
  const RegionContact& chest = region(result, "chest");
  EXPECT_EQ(chest.quasi_static_force, 0.0);
  EXPECT_EQ(chest.transient_force, 200.0);
  EXPECT_EQ(chest.transient_contacts, 1);
  EXPECT_EQ(chest.verdict, ContactFinding::kWithin);  // over 140 N, but not held
  EXPECT_NEAR(*chest.worst_ratio, 200.0 / 280.0, kRounding);
}

TEST(ContactSafety, HalfASecondIsTransientAndOneStepMoreIsHeld) {
  for (const double dt : {0.001, 0.002, 0.005}) {
    const RegionContact chest = fed(1.0, pulse(kChestA, 50.0, 0.0, 0.5), dt).regions[0];
    EXPECT_EQ(chest.quasi_static_force, 0.0) << dt;
    EXPECT_EQ(chest.transient_contacts, 1) << dt;
    const RegionContact longer = fed(1.0, pulse(kChestA, 50.0, 0.0, 0.5 + dt), dt).regions[0];
    EXPECT_EQ(longer.quasi_static_force, 50.0) << dt;
    EXPECT_EQ(longer.transient_contacts, 0) << dt;
  }
}

// 250 steps are half a second, 251 are longer.
TEST(ContactSafety, WithinALongContactTheSpanCountsToo) {
  for (const auto& [steps, held] : {std::pair(250, 10.0), std::pair(251, 50.0)}) {
    const double end = 0.4 + 0.002 * steps;
    const ContactSafetyResult result =
        fed(1.5, [=](double t) { return std::vector{touch(kChestA, t > 0.4 && t < end ? 50.0 : 10.0)}; }, 0.002,
            {.bridge = 0.0});
    EXPECT_EQ(region(result, "chest").quasi_static_force, held) << steps;
  }
}

TEST(ContactSafety, TwoShortContactsAreNotHeld) {
  const ContactSafetyResult result = fed(
      1.0, [](double t) { return t < 0.48 || t > 0.51 ? std::vector{touch(kChestA, 50.0)} : std::vector<Contact>(); });
  EXPECT_EQ(region(result, "chest").quasi_static_force, 0.0);
  EXPECT_EQ(region(result, "chest").transient_contacts, 2);
}

TEST(ContactSafety, ABlowInALongContactIsHeldAgainstTheTransientLimit) {
  const ContactSafetyResult result =
      fed(3.0, [](double t) { return std::vector{touch(kChestA, t > 2.0 && t < 2.05 ? 300.0 : 20.0)}; });
  const RegionContact& chest = region(result, "chest");
  EXPECT_EQ(chest.peak_force, 300.0);
  EXPECT_EQ(chest.quasi_static_force, 20.0);
  EXPECT_EQ(chest.transient_force, 20.0);  // of the first 0.5 s
  EXPECT_EQ(chest.verdict, ContactFinding::kOver);
  EXPECT_NEAR(*chest.worst_ratio, 300.0 / 280.0, kRounding);
}

TEST(ContactSafety, CapsulesOfOneRegionSumAsVectors) {
  const ContactSafetyResult result = fed(1.0, [](double) {
    return std::vector{touch(kChestA, {30.0, 0.0, 0.0}, 3), touch(kChestB, {0.0, 40.0, 0.0}, 3)};
  });
  const RegionContact& chest = region(result, "chest");
  EXPECT_DOUBLE_EQ(chest.peak_force, 50.0);
  EXPECT_DOUBLE_EQ(chest.peak_pair_force, 40.0);
  EXPECT_EQ(chest.contacts, 1);
  EXPECT_EQ(result.events.size(), 2u);
}

TEST(ContactSafety, PointsOfOnePairSumAsVectorsBeforeTheyAreCompared) {
  const ContactSafetyResult result = fed(1.0, [](double) {
    return std::vector{touch(kChestA, {30.0, 0.0, 0.0}, 3, 0.001), touch(kChestA, {30.0, 0.0, 0.0}, 3, 0.004)};
  });
  EXPECT_EQ(region(result, "chest").peak_pair_force, 60.0);
  ASSERT_EQ(result.events.size(), 1u);
  EXPECT_EQ(result.events[0].peak_n, 60.0);
  EXPECT_EQ(result.events[0].depth_m, 0.004);
}

TEST(ContactSafety, ASqueezeFromTwoSidesDoesNotCancel) {
  const ContactSafetyResult result = fed(1.0, [](double) {
    return std::vector{touch(kChestA, 90.0, 1), touch(kChestA, -90.0, 2)};
  });
  EXPECT_EQ(region(result, "chest").peak_force, 90.0);
  EXPECT_EQ(region(result, "chest").quasi_static_force, 90.0);
}

// Two links in turn, 50 ms each: the region bears 50 N without a break, each pair's contacts end.
TEST(ContactSafety, AlternatingLinksAreOneContactOfTheRegionAndManyEvents) {
  const ContactSafetyResult result =
      fed(1.0, [](double t) { return std::vector{touch(kChestA, 50.0, static_cast<int>(t / 0.05) % 2)}; });
  const RegionContact& chest = region(result, "chest");
  EXPECT_EQ(chest.contacts, 1);
  EXPECT_EQ(chest.quasi_static_force, 50.0);
  ASSERT_EQ(result.events.size(), 20u);
  for (int e = 0; e < 20; ++e) {
    EXPECT_EQ(result.events[e].link, e % 2);
    EXPECT_NEAR(result.events[e].begin_s, 0.05 * e, kRounding);
    EXPECT_NEAR(result.events[e].duration_s, 0.05, kRounding);
    EXPECT_NEAR(result.events[e].impulse_ns, 2.5, kRounding);
    EXPECT_NEAR(result.events[e].windowed_mean_n, 25.0, kRounding);  // half of the window
  }
}

TEST(ContactSafety, AlternatingCapsulesKeepTheirRegionsApart) {
  const ContactSafetyResult result = fed(
      2.0, [](double t) { return std::vector{touch(static_cast<int>(t / 0.4) % 2 == 0 ? kChestA : kHandLeft, 50.0)}; });
  EXPECT_EQ(region(result, "chest").contacts, 3);
  EXPECT_EQ(region(result, "hand").contacts, 2);
  EXPECT_EQ(region(result, "chest").quasi_static_force, 0.0);
  EXPECT_NEAR(region(result, "chest").impulse, 60.0, kRounding);
  EXPECT_NEAR(region(result, "hand").impulse, 40.0, kRounding);
  EXPECT_NEAR(result.impulse, 100.0, kRounding);
}

TEST(ContactSafety, GapsUpToTheBridgeDoNotEndAContact) {
  const auto with_gap = [](double gap) {
    return fed(1.0, [=](double t) {
      return t < 0.3 || t > 0.3 + gap ? std::vector{touch(kChestA, 50.0)} : std::vector<Contact>();
    });
  };
  const ContactSafetyResult bridged = with_gap(0.02);
  EXPECT_EQ(bridged.events.size(), 1u);
  EXPECT_NEAR(bridged.events[0].duration_s, 1.0, kRounding);
  EXPECT_NEAR(bridged.events[0].impulse_ns, 50.0 * 0.98, kRounding);
  EXPECT_EQ(region(bridged, "chest").contacts, 1);
  const ContactSafetyResult apart = with_gap(0.022);
  EXPECT_EQ(apart.events.size(), 2u);
  EXPECT_EQ(region(apart, "chest").contacts, 2);
}

// A contact that chatters step by step presses with its mean.
TEST(ContactSafety, AChatteringForceIsHeldAtItsMean) {
  int k = 0;
  const ContactSafetyResult result =
      fed(1.0, [&](double) { return k++ % 2 == 0 ? std::vector{touch(kChestA, 80.0)} : std::vector<Contact>(); });
  const RegionContact& chest = region(result, "chest");
  EXPECT_EQ(chest.contacts, 1);
  EXPECT_NEAR(chest.quasi_static_force, 40.0, kRounding);
  EXPECT_EQ(chest.peak_force, 80.0);
}

TEST(ContactSafety, FiguresDoNotDependOnTheStep) {
  const ContactsAt bump = [](double t) {
    const double x = (t - 1.0) / 0.4;
    return std::vector{touch(kChestA, {30.0, 200.0 * std::exp(-x * x), 0.0}, 0, 0.01 * std::exp(-x * x)),
                       touch(kChestB, {20.0, 0.0, 0.0}, 1)};
  };
  constexpr double kSlope = 200.0 * 0.86 / 0.4;  // the steepest [N/s]
  const ContactSafetyResult fine = fed(2.0, bump, 0.001), coarse = fed(2.0, bump, 0.002);
  const RegionContact &a = region(fine, "chest"), &b = region(coarse, "chest");
  EXPECT_NEAR(a.peak_force, b.peak_force, kSlope * 0.002);
  EXPECT_NEAR(a.quasi_static_force, b.quasi_static_force, kSlope * 0.002);
  EXPECT_NEAR(a.transient_force, b.transient_force, kSlope * 0.002);
  EXPECT_NEAR(a.windowed_mean, b.windowed_mean, kSlope * 0.002);
  EXPECT_NEAR(a.impulse, b.impulse, 1e-3 * a.impulse);
  EXPECT_NEAR(a.pressure_n_cm2, b.pressure_n_cm2, 1e-3 * a.pressure_n_cm2);
  EXPECT_NEAR(a.longest, b.longest, kRounding);
  ASSERT_EQ(fine.events.size(), coarse.events.size());
  EXPECT_NEAR(fine.events[0].windowed_mean_n, coarse.events[0].windowed_mean_n, kSlope * 0.002);
}

TEST(ContactSafety, ALimitThatIsReachedIsKeptAndTheNextNumberIsOver) {
  for (int tenths = 1; tenths <= 100; ++tenths) {  // the mean over a window may round
    const double limit = 0.1 * tenths;
    ContactLimits limits = contact_table();
    limits.regions[0] = {.region = "chest", .quasi_static_n = limit, .transient_n = limit};
    const RegionContact at = fed(1.0, pulse(kChestA, limit, 0.1, 0.9), 0.002, {}, limits).regions[0];
    EXPECT_EQ(at.verdict, ContactFinding::kWithin) << limit;
    EXPECT_NEAR(*at.worst_ratio, 1.0, kRounding);
    const RegionContact past = fed(1.0, pulse(kChestA, limit * 1.000001, 0.1, 0.9), 0.002, {}, limits).regions[0];
    EXPECT_EQ(past.verdict, ContactFinding::kOver) << limit;
    EXPECT_GT(*past.worst_ratio, 1.0);
  }
}

TEST(ContactSafety, ATransientContactOfTheHeadIsNotAllowedHoweverLight) {
  const ContactSafetyResult brief = fed(1.0, pulse(kHead, 6.5, 0.1, 0.3));
  EXPECT_EQ(region(brief, "head").verdict, ContactFinding::kNotAllowed);
  EXPECT_NEAR(*region(brief, "head").worst_ratio, 1.1, kRounding);
  EXPECT_EQ(brief.verdict, ContactFinding::kNotAllowed);

  const ContactSafetyResult held = fed(1.0, pulse(kHead, 6.5, 0.1, 0.9));
  EXPECT_EQ(region(held, "head").verdict, ContactFinding::kWithin);
  EXPECT_NEAR(*region(held, "head").worst_ratio, 0.1, kRounding);
}

// Without an allowance for blows, the peak of a longer contact counts in full.
TEST(ContactSafety, ABlowInALongContactOfTheHeadIsOver) {
  const ContactSafetyResult result =
      fed(2.0, [](double t) { return std::vector{touch(kHead, t > 1.0 && t < 1.01 ? 130.0 : 5.0)}; });
  EXPECT_EQ(region(result, "head").verdict, ContactFinding::kOver);
  EXPECT_NEAR(*region(result, "head").worst_ratio, 2.0, kRounding);
}

TEST(ContactSafety, WhatHasNoLimitIsUnlimited) {
  const ContactSafetyResult result = fed(1.0, pulse(kFoot, 1e4, 0.0, 1.0));
  EXPECT_EQ(region(result, "foot").verdict, ContactFinding::kUnlimited);
  EXPECT_FALSE(region(result, "foot").worst_ratio);
  EXPECT_FALSE(result.worst_ratio);
  EXPECT_EQ(result.verdict, ContactFinding::kUnlimited);
}

TEST(ContactSafety, PressureIsForceOverTheOverlapOfTwoSpheres) {
  const ContactSafetyOptions options{.link_radius = {0.0, 0.06}, .default_link_radius = 0.04};
  const auto pressure = [&](int link, double depth) {
    return fed(
               0.1, [=](double) { return std::vector{touch(kChestA, 100.0, link, depth)}; }, 0.002, options)
        .regions[0]
        .pressure_n_cm2;
  };
  constexpr double kPi = std::numbers::pi;
  // 1/R = 1/0.12 + 1/0.06 = 1/0.04; 1/0.12 + 1/0.04 = 1/0.03.
  EXPECT_NEAR(pressure(1, 0.01), 1e-4 * 100.0 / (2.0 * kPi * 0.04 * 0.01), kRounding);
  for (const int link : {0, 2, -1})
    EXPECT_NEAR(pressure(link, 0.01), 1e-4 * 100.0 / (2.0 * kPi * 0.03 * 0.01), kRounding);
  EXPECT_NEAR(pressure(1, 0.0), 100.0, kRounding);    // the floor of 1 cm^2
  EXPECT_NEAR(pressure(1, -0.01), 100.0, kRounding);  // a gap
}

TEST(ContactSafety, PressureIsHeldAgainstItsLimit) {
  const ContactSafetyResult result = fed(0.1, [](double) { return std::vector{touch(kChestA, 130.0, 0, 0.0)}; });
  EXPECT_NEAR(*region(result, "chest").pressure_ratio, 130.0 / 120.0, kRounding);
  EXPECT_EQ(region(result, "chest").verdict, ContactFinding::kOver);
}

// Signals with plateaus, ties and zeros.
std::vector<double> nasty_signal(int size) {
  std::vector<double> signal;
  for (int k = 0; k < size; ++k) signal.push_back(k % 7 == 0 ? 0.0 : static_cast<double>((k * k * 31 + k / 5) % 11));
  return signal;
}

TEST(SlidingWindow, AgreesWithTheDefinition) {
  const std::vector<double> signal = nasty_signal(200);
  for (const int length : {1, 2, 3, 10, 199, 200, 250}) {
    SlidingMean mean(length);
    SlidingMinimum minimum(length);
    for (int k = 0; k < 200; ++k) {
      const auto last = signal.begin() + k + 1, first = signal.begin() + std::max(0, k + 1 - length);
      EXPECT_NEAR(mean.push(signal[k]), std::accumulate(first, last, 0.0) / length, 1e-13) << length << ' ' << k;
      EXPECT_EQ(minimum.push(signal[k]), k + 1 < length ? 0.0 : *std::min_element(first, last)) << length << ' ' << k;
    }
  }
}

TEST(SlidingMean, AVeryLargeSampleLeavesNothingBehind) {
  SlidingMean mean(10);
  mean.push(1e18);
  for (int k = 0; k < 19; ++k) mean.push(1.0);
  EXPECT_EQ(mean.push(1.0), 1.0);
}

TEST(SlidingMean, ClearForgets) {
  SlidingMean mean(4);
  mean.push(8.0);
  mean.clear();
  EXPECT_EQ(mean.push(4.0), 1.0);
}

}  // namespace
}  // namespace duet
