#include "duet/metrics/contact_limits.h"

#include <array>
#include <set>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/robots/human_body.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

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

}  // namespace
}  // namespace duet
