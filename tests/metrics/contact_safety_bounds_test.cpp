// Contact safety where nothing, too much or nonsense comes in, and what its figures are called.
#include <gmock/gmock.h>

#include <array>
#include <limits>
#include <span>
#include <utility>

#include "duet/metrics/catalogue.h"
#include "duet/metrics/contact_safety.h"
#include "tests/metrics/contact_scene.h"
#include "tests/robots/allocations.h"
#include "tests/support.h"

namespace duet {
namespace {

using Eigen::Vector3d;
using test::contact_body;
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
using test::thrown_message;
using test::touch;
using ::testing::Key;
using ::testing::UnorderedElementsAre;

TEST(ContactSafety, NothingHappenedWithoutContact) {
  Contact ground = touch(-1, 400.0);
  ground.side = ContactSide::kGround;
  const ContactSafetyResult result = fed(1.0, [&](double) {
    return std::vector{ground, touch(kChestA, 0.0), touch(kHead, 1e-6)};
  });
  EXPECT_EQ(result.peak_force, 0.0);
  EXPECT_EQ(result.impulse, 0.0);
  EXPECT_EQ(result.worst_ratio, 0.0);
  EXPECT_EQ(result.verdict, ContactFinding::kWithin);
  EXPECT_TRUE(result.events.empty());
  EXPECT_EQ(result.regions.size(), 4u);
  for (const RegionContact& entry : result.regions) EXPECT_EQ(entry.contacts, 0);
  EXPECT_EQ(fed(0.0, [](double) { return std::vector<Contact>(); }).duration, 0.0);
}

TEST(ContactSafety, EventsPastTheCapAreCounted) {
  const ContactsAt taps = [](double t) {
    return std::fmod(t, 0.1) < 0.05 ? std::vector{touch(kChestA, 50.0)} : std::vector<Contact>();
  };
  const ContactSafetyResult result = fed(1.0, taps, 0.002, {.max_events = 4});
  EXPECT_EQ(result.events.size(), 4u);
  EXPECT_EQ(result.events_left_out, 6);
  EXPECT_EQ(region(result, "chest").contacts, 10);
}

TEST(ContactSafety, PairsPastTheCapStillPressOnTheirRegion) {
  const ContactsAt two = [](double) { return std::vector{touch(kChestA, 50.0, 1), touch(kHandLeft, 70.0, 2)}; };
  const ContactSafetyResult result = fed(1.0, two, 0.002, {.max_pairs = 1});
  EXPECT_EQ(result.contacts_unfollowed, 500);
  EXPECT_EQ(result.events.size(), 1u);
  EXPECT_EQ(region(result, "hand").quasi_static_force, 70.0);
  EXPECT_GT(region(result, "hand").pressure_n_cm2, 0.0);
}

TEST(ContactSafety, ForcesThatAreNotFiniteAreCountedAndIgnored) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  const ContactSafetyResult result = fed(0.002, [&](double) {
    return std::vector{touch(kChestA, nan), touch(kChestA, infinity), touch(kChestA, 5.0, 0, nan), touch(kChestA, 5.0)};
  });
  EXPECT_EQ(result.contacts_not_finite, 3);
  EXPECT_EQ(result.peak_force, 5.0);
}

TEST(ContactSafety, ResultMayBeAskedForAtAnyTime) {
  ContactSafety asked(contact_body(), contact_table(), 0.002), left_alone(contact_body(), contact_table(), 0.002);
  for (int k = 0; k < 400; ++k) {
    const std::vector<Contact> contacts{touch(kChestA, 50.0 + k % 3)};
    asked.add(contacts);
    left_alone.add(contacts);
    if (k == 100) {
      const ContactSafetyResult now = asked.result();
      EXPECT_EQ(region(now, "chest").transient_contacts, 1);
      ASSERT_EQ(now.events.size(), 1u);
      EXPECT_NEAR(now.events[0].duration_s, 101 * 0.002, kRounding);
    }
  }
  EXPECT_EQ(contact_forces(asked.result()), contact_forces(left_alone.result()));
  EXPECT_EQ(asked.result().events.size(), 1u);
}

TEST(ContactSafety, AddDoesNotAllocate) {
  if (!test::counts_allocations()) GTEST_SKIP() << "not run: a sanitizer replaces malloc";
  ContactSafety safety(contact_body(), contact_table(), 0.002, {.max_events = 8});
  std::array<Contact, 3> contacts{touch(kChestA, 50.0, 1), touch(kChestB, 20.0, 2), touch(kHead, 20.0, 3)};
  const long before = test::allocations();
  for (int k = 0; k < 3000; ++k)
    safety.add(std::span(contacts).first(k % 100 < 50 ? static_cast<std::size_t>(k % 4) : 0));
  EXPECT_EQ(test::allocations(), before);
}

TEST(ContactSafety, EveryRegionOfTheBodyNeedsAnEntry) {
  ContactLimits limits = contact_table();
  limits.regions.pop_back();
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { ContactSafety(contact_body(), limits, 0.002); }));
  limits = contact_table();
  limits.regions[1].quasi_static_n.reset();
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { ContactSafety(contact_body(), limits, 0.002); }));
}

TEST(ContactSafety, MisuseIsRefused) {
  const auto message = [](const ContactSafetyOptions& options, double dt = 0.002) {
    return thrown_message<std::invalid_argument>([&] { ContactSafety(contact_body(), contact_table(), dt, options); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_SENTENCE(message({}, 0.0));
  EXPECT_SENTENCE(message({}, nan));
  EXPECT_SENTENCE(message({}, 0.6));
  EXPECT_SENTENCE(message({.hold = -1.0}));
  EXPECT_SENTENCE(message({.bridge = -1.0}));
  EXPECT_SENTENCE(message({.bridge = 0.7}));
  EXPECT_SENTENCE(message({.mean_window = 0.0}));
  EXPECT_SENTENCE(message({.least_force = nan}));
  EXPECT_SENTENCE(message({.least_patch = 0.0}));
  EXPECT_SENTENCE(message({.link_radius = {0.1, -0.1}}));
  EXPECT_SENTENCE(message({.default_link_radius = 0.0}));
  EXPECT_SENTENCE(message({.max_events = -1}));
  EXPECT_SENTENCE(message({.max_pairs = -1}));
  for (const int capsule : {-1, 6})
    EXPECT_SENTENCE(thrown_message<std::invalid_argument>(
        [&] { fed(0.002, [&](double) { return std::vector{touch(capsule, 1.0)}; }); }));
}

TEST(ContactSafety, LinkRadiusIsTheSmallestOfTheLinksShapes) {
  RobotModel robot;
  robot.links.resize(3);
  for (const auto& [link, radius] : {std::pair(0, 0.1), std::pair(2, 0.05), std::pair(2, 0.02)}) {
    RobotShape& shape = robot.shapes.emplace_back();
    shape.link = link;
    shape.radius = radius;
  }
  EXPECT_EQ(link_radii(robot), (std::vector{0.1, 0.0, 0.02}));
}

TEST(ContactForces, NameWhatWasTouched) {
  const ContactSafetyResult result = fed(1.0, [](double) {
    return std::vector{touch(kChestA, 50.0, 0, 0.01), touch(kFoot, 30.0, 1)};
  });
  const std::map<std::string, double> forces = contact_forces(result);
  EXPECT_THAT(forces,
              UnorderedElementsAre(
                  Key("human.peak_n"), Key("human.settled_n"), Key("human.impulse_ns"), Key("human.worst_ratio"),
                  Key("human.settled_ratio"), Key("human.limits_verified"), Key("human.chest.peak_n"),
                  Key("human.chest.settled_n"), Key("human.chest.quasi_static_n"), Key("human.chest.transient_n"),
                  Key("human.chest.impulse_ns"), Key("human.chest.pressure_n_cm2"), Key("human.chest.worst_ratio"),
                  Key("human.foot.peak_n"), Key("human.foot.settled_n"), Key("human.foot.quasi_static_n"),
                  Key("human.foot.transient_n"), Key("human.foot.impulse_ns"), Key("human.foot.pressure_n_cm2")));
  EXPECT_EQ(forces.at("human.peak_n"), 50.0);
  EXPECT_NEAR(forces.at("human.impulse_ns"), 80.0, kRounding);
  EXPECT_EQ(forces.at("human.foot.quasi_static_n"), 30.0);
  EXPECT_EQ(forces.at("human.worst_ratio"), forces.at("human.chest.worst_ratio"));
}

// A blow of 0.1 s is forgiven, what comes later is not.
TEST(ContactSafety, ASettledForceIsWhatComesAfterTheBlow) {
  const auto pushed = [](double blow, double after) {
    return fed(0.4, [=](double t) { return std::vector{touch(kChestA, t < 0.099 ? blow : after, 0, 0.01)}; });
  };
  const double limit = contact_table().region("chest").transient_n.value();
  EXPECT_NEAR(pushed(5.0 * limit, 0.5 * limit).settled_ratio.value(), 0.5, kRounding);
  EXPECT_NEAR(pushed(0.5 * limit, 1.5 * limit).settled_ratio.value(), 1.5, kRounding);
  EXPECT_EQ(fed(1.0, [](double) { return std::vector<Contact>{}; }).settled_ratio, 0.0);
}

TEST(ContactSafetyMetrics, AreInTheCatalogue) {
  const std::map<std::string, double> metrics = contact_safety_metrics(fed(1.0, pulse(kChestA, 70.0, 0.0, 1.0)));
  EXPECT_EQ(metrics.at("contact_peak_force"), 70.0);
  EXPECT_EQ(metrics.at("contact_quasi_static_force"), 70.0);
  EXPECT_NEAR(metrics.at("contact_impulse"), 70.0, kRounding);
  EXPECT_NEAR(metrics.at("contact_limit_ratio"), 0.5, kRounding);
  for (const auto& [name, value] : metrics) EXPECT_EQ(metric_info(name).group, MetricGroup::kEpisode) << name;
  EXPECT_EQ(metric_info("contact_limit_ratio").direction, Direction::kLower);
  EXPECT_EQ(metric_info("contact_limit_ratio").unit, "1");
}

TEST(ContactSafety, OutputsSayWhetherTheLimitsAreVerified) {
  const ContactsAt press = [](double) {
    return std::vector{touch(kChestA, 70.0, 0, 0.02), touch(kFoot, 10.0, 0, 0.02)};
  };
  const ContactSafetyResult result = fed(1.0, press);
  EXPECT_EQ(result.limits, "table (unverified limits)");
  EXPECT_EQ(contact_forces(result).at("human.limits_verified"), 0.0);
  EXPECT_SENTENCE(contact_safety_text(result));

  ContactLimits limits = contact_table();
  limits.verified_by = "A. Person";
  const ContactSafetyResult verified = fed(1.0, press, 0.002, {}, limits);
  EXPECT_EQ(verified.limits, "table (limits verified by A. Person)");
  EXPECT_EQ(contact_forces(verified).at("human.limits_verified"), 1.0);
}

}  // namespace
}  // namespace duet
