#include "duet/app/retarget_comparison.h"

#include <gmock/gmock.h>

#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

TEST(RetargetComparison, ModesTakeTheCommonChoices) {
  const std::vector<RetargetVariant> variants = mode_variants({"paper", "best"}, {{"w-kin", "3"}});
  ASSERT_EQ(variants.size(), 2U);
  EXPECT_FALSE(variants[0].options.ground);
  EXPECT_TRUE(variants[1].options.ground);
  for (const RetargetVariant& variant : variants) EXPECT_EQ(variant.options.weights.kin, 3.0);
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([] { mode_variants({"bset"}, {}); }), HasSubstr("grounded"));
}

TEST(RetargetComparison, SweepHalvesAndDoublesEachWeightAlone) {
  const std::vector<RetargetVariant> variants = weight_variants({});
  ASSERT_EQ(variants.size(), 9U);
  EXPECT_EQ(variants[1].name, "w_kin x 0.5");
  EXPECT_EQ(variants[1].options.weights.kin, 0.5);
  EXPECT_EQ(variants[4].options.weights.con, 0.5);
  EXPECT_EQ(variants[4].options.weights.kin, 1.0);
  EXPECT_EQ(variants[8].options.weights.temp, 10.0);
  EXPECT_EQ(variants[8].options.weights.pose, 0.04);
}

TEST(RetargetComparison, TablesHaveAColumnAVariantAndARowAWeight) {
  Progress quiet(Progress::Style::kQuiet);
  const std::vector<ComparedVariant> compared =
      compare_retargeting({test::random_clip(30, 1), test::random_clip(20, 2)},
                          mode_variants({"paper", "grounded"}, {}), test::g1(), 2, quiet);
  ASSERT_EQ(compared.size(), 2U);
  EXPECT_EQ(compared[0].clips, 2);
  EXPECT_GT(compared[0].frames_per_second, 0.0);
  EXPECT_LT(compared[1].figures.at("bone_change_max").worst, 1e-6);
  EXPECT_GT(compared[0].figures.at("bone_change_max").worst, 1e-3);
  EXPECT_GE(compared[0].figures.at("jpe").worst, compared[0].figures.at("jpe").mean);
  EXPECT_THAT(comparison_table(compared), HasSubstr("paper"));
  EXPECT_THAT(weights_table(compared), HasSubstr("Large-angle"));
  EXPECT_EQ(comparison_json(compared).size(), 2U);
}

}  // namespace
}  // namespace duet
