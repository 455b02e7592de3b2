#include "duet/metrics/readings.h"

#include <gmock/gmock.h>

#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Readings, DefaultsAreTheFirstOfEachRow) {
  const Readings defaults;
  for (const std::string& name : reading_names()) EXPECT_EQ(reading(defaults, name), reading_values(name).front());
}

TEST(Readings, EveryValueOfEveryOptionRoundTrips) {
  for (const std::string& name : reading_names()) {
    for (const std::string& value : reading_values(name)) {
      Readings readings;
      set_reading(readings, name, value);
      EXPECT_EQ(reading(readings, name), value) << name;
    }
  }
}

TEST(Readings, SettingOneOptionLeavesTheOthers) {
  for (const std::string& name : reading_names()) {
    Readings readings;
    set_reading(readings, name, reading_values(name).back());
    for (const std::string& other : reading_names()) {
      if (other != name) {
        EXPECT_EQ(reading(readings, other), reading_values(other).front()) << name << " " << other;
      }
    }
  }
}

TEST(Readings, NamesReachTheirMembers) {
  Readings readings;
  set_reading(readings, "metrics.matching", "source_sequence");
  set_reading(readings, "metrics.ddof", "1");
  set_reading(readings, "handshake.ddof", "1");
  set_reading(readings, "wave.displacement", "since_last");
  set_reading(readings, "fly_kiss.order", "after_first_close");
  set_reading(readings, "diagnostics.root_jerk", "rms");
  set_reading(readings, "diagnostics.dof_jerk", "mean_norm");
  EXPECT_EQ(readings.metrics.matching, HandMatching::kSourceSequence);
  EXPECT_EQ(readings.metrics.ddof, 1);
  EXPECT_EQ(readings.detectors.handshake_ddof, 1);
  EXPECT_EQ(readings.detectors.wave_displacement, WaveDisplacement::kSinceLast);
  EXPECT_EQ(readings.detectors.fly_kiss_order, FlyKissOrder::kAfterFirstClose);
  EXPECT_EQ(readings.diagnostics.root_jerk, JerkNorm::kRms);
  EXPECT_EQ(readings.diagnostics.dof_jerk, JerkNorm::kMeanNorm);
}

TEST(Readings, ListsTheNamesOfTheReferencePage) {
  EXPECT_EQ(reading_names().size(), 37U);
  EXPECT_THAT(reading_values("metrics.matching"),
              ElementsAre("independent_frame", "source_frame", "independent_sequence", "source_sequence",
                          "independent_bottleneck"));
  EXPECT_THAT(reading_values("diagnostics.root_jerk"), ElementsAre("mean_norm", "rms"));
  EXPECT_THAT(reading_values("high_five.height"),
              ElementsAre("closest_pair", "performer_closest", "partner_closest", "any_hand", "performer_any", "off"));
}

TEST(Readings, MinFramesTakesWholeNumbersFromOne) {
  Readings readings;
  set_reading(readings, "metrics.min_frames", "12");
  EXPECT_EQ(readings.metrics.min_frames, 12);
  EXPECT_EQ(reading(readings, "metrics.min_frames"), "12");
  for (const char* wrong : {"0", "-1", "2.5", "", "two", "3 ", "99999999999999999999"})
    EXPECT_SENTENCE(
        test::thrown_message<std::invalid_argument>([&] { set_reading(readings, "metrics.min_frames", wrong); }));
}

TEST(Readings, RefusesUnknownNamesAndListsTheKnownOnes) {
  Readings readings;
  const std::string option =
      test::thrown_message<std::invalid_argument>([&] { set_reading(readings, "metrics.jpe_fram", "world"); });
  EXPECT_THAT(option, HasSubstr("metrics.jpe_frame"));
  EXPECT_THAT(option, HasSubstr("metrics.min_frames"));  // of so many, the near ones
  const std::string value =
      test::thrown_message<std::invalid_argument>([&] { set_reading(readings, "hug.single", "all"); });
  EXPECT_THAT(value, HasSubstr("hug.single"));
  EXPECT_THAT(value, HasSubstr("any_hand, same_hand, exactly_one, off"));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)reading(readings, "nothing"); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)reading_values("nothing"); }));
  // root_jerk has no mean over axes.
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { set_reading(readings, "diagnostics.root_jerk", "mean_abs"); }));
}

}  // namespace
}  // namespace duet
