#include "duet/metrics/catalogue.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <set>

#include "duet/core/require.h"
#include "duet/metrics/retargeting.h"
#include "tests/metrics/points.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::HasSubstr;

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

// Metrics that a program adds. Each test ends its own process: what is added stays.

PairedMotion standing(const RobotModel& robot, int frames) {
  PairedMotion motion;
  motion.robot.joint_names = robot.joint_names();
  motion.robot.q = robot.neutral.replicate(1, frames);
  motion.robot.root.assign(static_cast<std::size_t>(frames), Pose{});
  motion.partner.joints = test::random_points(frames, kSmplJoints, 1);
  motion.source_partner = motion.source_reactor = motion.partner;
  return motion;
}

double count_frames(const PairedMotion& motion, const RobotModel&) { return motion.frames(); }

void add_length(std::string name) {  // the texts are gone when it returns
  const std::string unit = "frames";
  register_metric({name, unit, Direction::kNone, MetricGroup::kEpisode, "Length", "tests"}, count_frames);
}

void is_computed_beside_the_eighteen() {
  const RobotModel robot = load_robot(default_card_path());
  const PairedMotion motion = standing(robot, 20);
  const auto eighteen = retargeting_metrics(motion, robot);
  EXPECT_EQ(score_motion(motion, robot).size(), eighteen.size());
  add_length("length_of_a_motion_in_frames");
  const auto scores = score_motion(motion, robot);
  EXPECT_EQ(scores.size(), eighteen.size() + 1);
  EXPECT_EQ(scores.at("length_of_a_motion_in_frames"), 20.0);
  EXPECT_EQ(scores.at("jerk_mean"), eighteen.at("jerk_mean"));
  const std::vector<MetricInfo> infos = motion_metric_infos();
  ASSERT_EQ(infos.size(), 19u);
  EXPECT_EQ(infos.front().name, "jpe");
  EXPECT_EQ(infos.back().name, "length_of_a_motion_in_frames");
  EXPECT_EQ(infos.back().unit, "frames");
  EXPECT_EQ(infos.back().group, MetricGroup::kRetargeting);
}

void takes_no_name_twice() {
  add_length("length");
  EXPECT_EQ(thrown_message<std::invalid_argument>([] { add_length("length"); }),
            "metric 'length' is there already: choose another name");
  EXPECT_EQ(thrown_message<std::invalid_argument>([] { add_length("hf_ratio"); }),
            "metric 'hf_ratio' is there already: choose another name");
  EXPECT_THAT(thrown_message<std::invalid_argument>([] {
                register_metric({"none", "1", Direction::kNone, MetricGroup::kEpisode, "None", "tests"}, nullptr);
              }),
              HasSubstr("metric 'none': expected a function, found none"));
}

template <typename Check>
[[noreturn]] void end_with(const Check& check) {
  check();
  std::exit(::testing::Test::HasFailure() ? 1 : 0);
}

TEST(AddedMetric, IsComputedBesideTheEighteen) {
  EXPECT_EXIT(end_with(is_computed_beside_the_eighteen), ::testing::ExitedWithCode(0), "");
}
TEST(AddedMetric, TakesNoNameThatIsThere) {
  EXPECT_EXIT(end_with(takes_no_name_twice), ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace duet
