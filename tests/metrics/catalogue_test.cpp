#include "duet/metrics/catalogue.h"

#include <set>

#include "tests/support.h"

namespace duet {
namespace {

TEST(Catalogue, NamesAreUniqueAndEveryFieldIsFilled) {
  std::set<std::string_view> names;
  for (const MetricInfo& info : metric_catalogue()) {
    EXPECT_TRUE(names.insert(info.name).second) << info.name;
    EXPECT_FALSE(info.unit.empty() || info.title.empty() || info.source.empty()) << info.name;
    EXPECT_EQ(&metric_info(info.name), &info);
  }
}

TEST(Catalogue, HasTheEighteenRetargetingMetrics) {
  int count = 0;
  for (const MetricInfo& info : metric_catalogue()) count += info.group == MetricGroup::kRetargeting;
  EXPECT_EQ(count, 18);
}

TEST(Catalogue, DirectionsFollowTheArrowsOfTheSupplement) {
  for (const char* name : {"jpe", "awd", "large_angle_ratio", "angle_std", "jerk_mean", "jerk_std", "hf_ratio",
                           "dof_jerk", "root_jerk", "root_error", "dof_error", "fell"})
    EXPECT_EQ(metric_info(name).direction, Direction::kLower) << name;
  for (const char* name : {"contact_precision_0.2", "contact_recall_0.35", "contact_f1_0.5", "contact_accuracy_0.2",
                           "success", "time_to_fall"})
    EXPECT_EQ(metric_info(name).direction, Direction::kHigher) << name;
  EXPECT_EQ(metric_info("jerk_mean").unit, "m/s^3");
  EXPECT_EQ(metric_info("root_angle_error").unit, "deg");
}

TEST(Catalogue, FiguresOfAReadingHaveTheirMetricsUnit) {
  EXPECT_EQ(metric_of_reading("jerk_mean.links.diff").unit, "m/s^3");
  EXPECT_EQ(metric_of_reading("contact_f1_0.35.source_frame").name, "contact_f1_0.35");
  EXPECT_EQ(metric_of_reading("jpe.pelvis").name, "jpe.pelvis");
  EXPECT_EQ(metric_of_reading("awd.with_hands.full").name, "awd");
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)metric_of_reading("jpee.world"); }));
}

TEST(Catalogue, UnknownNamesAreRefusedWithTheNearest) {
  const std::string message = test::thrown_message<std::invalid_argument>([] { (void)metric_info("contact_f1_0.36"); });
  EXPECT_SENTENCE(message);  // of so many, not all
}

}  // namespace
}  // namespace duet
