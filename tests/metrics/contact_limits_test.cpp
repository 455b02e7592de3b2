#include "duet/metrics/contact_limits.h"

#include <gmock/gmock.h>

#include <array>
#include <limits>
#include <set>
#include <span>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/metrics/catalogue.h"
#include "duet/metrics/contact_safety.h"
#include "duet/robots/human_body.h"
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

constexpr const char* kTable =
    "schema: duet.contact_limits/1\n"
    "name: mine\n"
    "source: a book\n"
    "verified_by:\n"
    "regions:\n"
    "  - {region: head, quasi_static_n: 65, transient_n: not_allowed, pressure_n_cm2: 110}\n"
    "  - {region: chest, quasi_static_n: 140, transient_n: 280, stiffness_n_mm: 25, mass_kg: 40}\n"
    "  - {region: foot}\n";

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kTable;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string error(const std::string& from, const std::string& to) {
  return thrown_message<InputError>([&] { (void)parse_contact_limits(replaced(from, to), "l.yaml"); });
}

TEST(ContactLimits, ReadsEveryKey) {
  const ContactLimits limits = parse_contact_limits(kTable, "l.yaml");
  EXPECT_EQ(limits.name, "mine");
  EXPECT_EQ(limits.source, "a book");
  ASSERT_EQ(limits.regions.size(), 3u);
  const RegionLimits& head = limits.region("head");
  EXPECT_EQ(head.quasi_static_n, 65.0);
  EXPECT_FALSE(head.transient_allowed);
  EXPECT_FALSE(head.transient_n);
  EXPECT_EQ(head.pressure_n_cm2, 110.0);
  const RegionLimits& chest = limits.region("chest");
  EXPECT_TRUE(chest.transient_allowed);
  EXPECT_EQ(chest.transient_n, 280.0);
  EXPECT_FALSE(chest.pressure_n_cm2);
  EXPECT_EQ(chest.stiffness_n_mm, 25.0);
  EXPECT_EQ(chest.mass_kg, 40.0);
  EXPECT_FALSE(limits.region("foot").quasi_static_n);
}

TEST(ContactLimits, AreUnverifiedUntilSomebodyIsNamed) {
  for (const char* nobody : {"verified_by:", "verified_by: \"\"", "verified_by: '  '", "verified_by: ~"}) {
    const ContactLimits limits = parse_contact_limits(replaced("verified_by:", nobody), "l.yaml");
    EXPECT_FALSE(limits.verified()) << nobody;
    EXPECT_EQ(limits.mark(), "unverified limits") << nobody;
  }
  const ContactLimits limits = parse_contact_limits(replaced("verified_by:", "verified_by: A. Person"), "l.yaml");
  EXPECT_TRUE(limits.verified());
  EXPECT_EQ(limits.mark(), "limits verified by A. Person");
  EXPECT_SENTENCE(error("verified_by:\n", ""));
  EXPECT_SENTENCE(error("verified_by:", "verified_by: [a, b]"));
}

TEST(ContactLimits, BrokenTablesAreRefusedWithFileAndLine) {
  EXPECT_SENTENCE(error("name: mine", "name: {"));
  EXPECT_SENTENCE(error("limits/1", "limits/2"));
  EXPECT_SENTENCE(error("source:", "sauce:"));
  EXPECT_SENTENCE(error("name: mine\n", ""));
  EXPECT_SENTENCE(error("transient_n: 280", "transient: 280"));
  EXPECT_SENTENCE(error("region: head, ", ""));
  EXPECT_SENTENCE(error("region: foot", "region: chest"));
  EXPECT_SENTENCE(thrown_message<InputError>([] {
    (void)parse_contact_limits(std::string(kTable).substr(0, std::string(kTable).find("regions")), "l.yaml");
  }));
}

TEST(ContactLimits, RefuseValuesThatAreNoLimits) {
  const std::string where = "l.yaml:7: contact limits of a region: ";
  EXPECT_EQ(error("quasi_static_n: 140", "quasi_static_n: 0"),
            where + "key 'quasi_static_n': expected a finite number above 0, found 0");
  EXPECT_EQ(error("mass_kg: 40", "mass_kg: -1"), where + "key 'mass_kg': expected a finite number above 0, found -1");
  EXPECT_EQ(error("stiffness_n_mm: 25", "stiffness_n_mm: soft"),
            where + "key 'stiffness_n_mm': expected a finite number above 0, found 'soft'");
  for (const char* wrong : {"never", "-3", ".inf", "0", ".nan"})
    EXPECT_EQ(error("transient_n: 280", std::string("transient_n: ") + wrong),
              where + "key 'transient_n': expected a number > 0 or 'not_allowed', found '" + wrong + "'");
  EXPECT_EQ(error("transient_n: 280", "transient_n: 139"),
            where + "key 'transient_n': expected at least 'quasi_static_n' = 140, found 139");
  EXPECT_EQ(error("quasi_static_n: 140, transient_n: 280", "transient_n: not_allowed"),
            where + "key 'transient_n': 'not_allowed' needs 'quasi_static_n', found none");
}

TEST(ContactLimits, AnUnknownRegionIsRefusedByName) {
  const ContactLimits limits = parse_contact_limits(kTable, "l.yaml");
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)limits.region("neck"); }));
}

TEST(DefaultContactLimits, CoverTheHumanBodyAndAreUnverified) {
  const ContactLimits limits = load_contact_limits(default_contact_limits_path());
  EXPECT_FALSE(limits.verified());
  std::array<double, 24> bones;
  bones.fill(0.2);
  for (const HumanCapsule& capsule : make_human_body(bones).capsules) {
    const RegionLimits& entry = limits.region(capsule.region);
    EXPECT_TRUE(entry.quasi_static_n && entry.pressure_n_cm2 && entry.mass_kg) << capsule.region;
    // The scene's skin and the table's stiffness are one figure.
    EXPECT_NEAR(*entry.stiffness_n_mm, 1e-3 * capsule.skin.stiffness, 1e-9) << capsule.region;
    if (capsule.region == "head")
      EXPECT_FALSE(entry.transient_allowed);
    else
      EXPECT_EQ(entry.transient_n, 2.0 * *entry.quasi_static_n) << capsule.region;
  }
  EXPECT_EQ(limits.region("head").quasi_static_n, 65.0);  // the face's
  EXPECT_EQ(limits.region("chest").quasi_static_n, 140.0);
  EXPECT_EQ(limits.region("foot").quasi_static_n, limits.region("shin").quasi_static_n);
}

TEST(DefaultContactLimits, AreTheSourceTreesUnlessDuetShareHasSome) {
  unsetenv("DUET_SHARE");
  const std::string shipped = std::string(DUET_SOURCE_DIR) + "/metrics/limits/iso_ts_15066.yaml";
  EXPECT_EQ(default_contact_limits_path(), shipped);
  const test::ScratchFolder folder;
  setenv("DUET_SHARE", (folder / "share").c_str(), 1);
  EXPECT_EQ(default_contact_limits_path(), shipped);  // nothing there: the next place
  write_file(folder / "share/metrics/limits/iso_ts_15066.yaml", kTable);
  EXPECT_EQ(load_contact_limits(default_contact_limits_path()).name, "mine");
  unsetenv("DUET_SHARE");
}

// Contact safety where nothing, too much or nonsense comes in, and what its figures are called.

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

  ContactLimits limits = contact_table();
  limits.verified_by = "A. Person";
  const ContactSafetyResult verified = fed(1.0, press, 0.002, {}, limits);
  EXPECT_EQ(verified.limits, "table (limits verified by A. Person)");
  EXPECT_EQ(contact_forces(verified).at("human.limits_verified"), 1.0);
}

}  // namespace
}  // namespace duet
