#include "duet/statistics/rater_agreement.h"

#include <array>
#include <cmath>
#include <numeric>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

// Two raters from their table: both 1, a alone, b alone, neither.
std::array<std::vector<int>, 2> two_raters(int both, int only_a, int only_b, int neither) {
  std::array<std::vector<int>, 2> raters;
  const auto add = [&](int times, int a, int b) {
    raters[0].insert(raters[0].end(), static_cast<std::size_t>(times), a);
    raters[1].insert(raters[1].end(), static_cast<std::size_t>(times), b);
  };
  add(both, 1, 1), add(only_a, 1, 0), add(only_b, 0, 1), add(neither, 0, 0);
  return raters;
}

double cohen(int both, int only_a, int only_b, int neither) {
  const auto [a, b] = two_raters(both, only_a, only_b, neither);
  return cohen_kappa(a, b);
}

TEST(CohenKappa, IsOneOfEqualRatersAndMinusOneOfOppositeOnes) {
  EXPECT_DOUBLE_EQ(cohen(7, 0, 0, 3), 1.0);
  EXPECT_DOUBLE_EQ(cohen(0, 5, 5, 0), -1.0);
}

TEST(CohenKappa, IsZeroOfIndependentRaters) {
  // a says yes to 60 %, b to 50 %; every cell of the table is the product of its margins.
  EXPECT_NEAR(cohen(30, 30, 20, 20), 0.0, 1e-15);
}

TEST(CohenKappa, MatchesTextbookTables) {
  EXPECT_NEAR(cohen(20, 5, 10, 15), 0.4, 1e-15);  // 0.7 agreed, 0.5 by chance
  EXPECT_NEAR(cohen(45, 15, 25, 15), (0.60 - 0.54) / 0.46, 1e-15);
  EXPECT_NEAR(cohen(25, 35, 5, 35), (0.60 - 0.46) / 0.54, 1e-15);
}

TEST(CohenKappa, IsNotDefinedWhereBothSayOneThingOnly) {
  EXPECT_TRUE(std::isnan(cohen(9, 0, 0, 0)));
  EXPECT_TRUE(std::isnan(cohen(0, 0, 0, 0)));
  EXPECT_DOUBLE_EQ(cohen(8, 2, 0, 0), 0.0);  // b says one thing only, a does not
}

TEST(CohenKappa, CountsASubjectAsOftenAsItsWeight) {
  const std::vector<int> a = {1, 0, 1, 0}, b = {1, 0, 0, 1};
  const std::vector<double> weights = {20, 15, 5, 10};
  EXPECT_NEAR(cohen_kappa(a, b, weights), 0.4, 1e-15);
}

// Fleiss 1971 as textbooks have it: ten subjects, fourteen raters, five categories.
std::vector<std::vector<int>> fourteen_raters() {
  constexpr std::array<std::array<int, 5>, 10> kCounts = {{{0, 0, 0, 0, 14},
                                                           {0, 2, 6, 4, 2},
                                                           {0, 0, 3, 5, 6},
                                                           {0, 3, 9, 2, 0},
                                                           {2, 2, 8, 1, 1},
                                                           {7, 7, 0, 0, 0},
                                                           {3, 2, 6, 3, 0},
                                                           {2, 5, 3, 2, 2},
                                                           {6, 5, 2, 1, 0},
                                                           {0, 2, 2, 3, 7}}};
  std::vector<std::vector<int>> raters(14);
  for (const auto& counts : kCounts) {
    std::size_t rater = 0;
    for (int category = 0; category < 5; ++category)
      for (int i = 0; i < counts[static_cast<std::size_t>(category)]; ++i) raters[rater++].push_back(category);
  }
  return raters;
}

TEST(FleissKappa, MatchesTheTextbookExample) {
  // Mean agreement 0.378, by chance 0.213.
  EXPECT_NEAR(fleiss_kappa(fourteen_raters()), 0.20993, 5e-6);
}

TEST(FleissKappa, IsOneOfEqualRatersAndDoesNotDependOnTheirOrder) {
  const std::vector<int> one = {0, 1, 2, 1, 0};
  EXPECT_DOUBLE_EQ(fleiss_kappa({one, one, one}), 1.0);
  std::vector<std::vector<int>> raters = fourteen_raters();
  std::ranges::reverse(raters);
  EXPECT_NEAR(fleiss_kappa(raters), fleiss_kappa(fourteen_raters()), 1e-15);
}

TEST(FleissKappa, IsNotDefinedOfOneCategoryAlone) {
  EXPECT_TRUE(std::isnan(fleiss_kappa({{2, 2}, {2, 2}, {2, 2}})));
  EXPECT_TRUE(std::isnan(fleiss_kappa({{}, {}, {}})));
}

TEST(Kappa, RefusesWhatAreNoRatings) {
  const auto refused = [](const std::vector<std::vector<int>>& raters, const std::vector<double>& weights = {}) {
    return thrown_message<std::invalid_argument>([&] { fleiss_kappa(raters, weights); });
  };
  EXPECT_SENTENCE(refused({{1}}));
  EXPECT_SENTENCE(refused({{1, 0}, {1}}));
  EXPECT_SENTENCE(refused({{1}, {-1}}));
  EXPECT_SENTENCE(refused({{1}, {1}}, {1.0, 2.0}));
}

TEST(Kappa, IntervalIsAroundTheValueAndRepeats) {
  const auto [a, b] = two_raters(20, 5, 10, 15);
  std::vector<int> clips(a.size());
  std::iota(clips.begin(), clips.end(), 0);
  ClusterBootstrap bootstrap(2000, 7), again(2000, 7);
  const Kappa kappa = kappa_by_cluster({a, b}, clips, bootstrap);
  EXPECT_EQ(kappa.n, 50);
  EXPECT_DOUBLE_EQ(kappa.agreed, 0.7);
  EXPECT_NEAR(kappa.value, 0.4, 1e-15);
  EXPECT_GT(kappa.interval.low, 0.4 - 0.30);  // the large-sample error is 0.127
  EXPECT_LT(kappa.interval.low, 0.4 - 0.17);
  EXPECT_GT(kappa.interval.high, 0.4 + 0.17);
  EXPECT_LT(kappa.interval.high, 0.4 + 0.30);
  EXPECT_EQ(kappa_by_cluster({a, b}, clips, again).interval.low, kappa.interval.low);
}

TEST(Kappa, ClipsWithSeveralEpisodesWidenTheInterval) {
  const auto [a, b] = two_raters(20, 5, 10, 15);
  std::vector<int> alone(a.size()), together(a.size());
  std::iota(alone.begin(), alone.end(), 0);
  for (std::size_t i = 0; i < together.size(); ++i) together[i] = static_cast<int>(i / 5);
  ClusterBootstrap bootstrap(2000, 7);
  const Interval narrow = kappa_by_cluster({a, b}, alone, bootstrap).interval;
  const Interval wide = kappa_by_cluster({a, b}, together, bootstrap).interval;
  EXPECT_GT(wide.high - wide.low, 1.3 * (narrow.high - narrow.low));
}

TEST(Kappa, HasNoIntervalWhereItIsNotDefined) {
  ClusterBootstrap bootstrap(100, 1);
  const Kappa kappa = kappa_by_cluster({{1, 1}, {1, 1}}, std::vector<int>{0, 1}, bootstrap);
  EXPECT_TRUE(std::isnan(kappa.value));
  EXPECT_TRUE(std::isnan(kappa.interval.low));
  const std::vector<int> one_clip(4, 7), a = {1, 0, 1, 0}, b = {1, 0, 0, 0};
  EXPECT_TRUE(std::isnan(kappa_by_cluster({a, b}, one_clip, bootstrap).interval.low));
  // Half of these resamples hold one clip alone, in which both say one thing: they are left out.
  const Kappa defined = kappa_by_cluster({{1, 0}, {1, 0}}, std::vector<int>{0, 1}, bootstrap);
  EXPECT_DOUBLE_EQ(defined.interval.low, 1.0);
  EXPECT_DOUBLE_EQ(defined.interval.high, 1.0);
}

}  // namespace
}  // namespace duet
