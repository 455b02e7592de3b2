// When the same episode in two engines parts: frame, points, falls, quartiles.
#include "duet/report/engines/cross_engine.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::traced;

Lifetime together(const EpisodeRow& a, const EpisodeRow& b) {
  const std::optional<Lifetime> lifetime = time_together(a, b, 0.05);
  EXPECT_TRUE(lifetime.has_value());
  const std::optional<Lifetime> turned = time_together(b, a, 0.05);
  EXPECT_EQ(turned->time, lifetime->time);
  EXPECT_EQ(turned->ended, lifetime->ended);
  return lifetime.value_or(Lifetime{});
}

TEST(EngineParting, IsTheFirstFrameFurtherApartThanAsked) {
  const EpisodeRow still = traced("mujoco", 0, {0, 0, 0, 0});
  Lifetime lifetime = together(still, traced("ode", 0, {0, 50, 51, 0}));
  EXPECT_TRUE(lifetime.ended);
  EXPECT_DOUBLE_EQ(lifetime.time, 0.2);
  lifetime = together(still, traced("ode", 0, {0, 50, -50, 0}));
  EXPECT_FALSE(lifetime.ended);
  EXPECT_DOUBLE_EQ(lifetime.time, 0.3);
  EpisodeRow hand = still;
  hand.trace.mm[1] = {0, 0, 0, 30, 330, 930};  // 52 mm along the diagonal
  EXPECT_DOUBLE_EQ(together(still, hand).time, 0.1);
}

TEST(EngineParting, PointsAreFoundByName) {
  const EpisodeRow a = traced("mujoco", 0, {0, 0, 0});
  EpisodeRow b = a;
  b.trace.points = {"left_hand", "head", "root"};
  for (std::vector<int>& frame : b.trace.mm) frame = {0, 300, 900, 7, 7, 7, 0, 0, 0};
  EXPECT_FALSE(together(a, b).ended);
  b.trace.mm[2][6] = 100;
  EXPECT_DOUBLE_EQ(together(a, b).time, 0.2);
}

TEST(EngineParting, AFallInOneEngineAloneIsAParting) {
  const EpisodeRow whole = traced("mujoco", 0, {0, 0, 0, 0, 0, 0});
  for (const Outcome outcome : {Outcome::kFell, Outcome::kDiverged}) {
    EpisodeRow fallen = traced("ode", 0, {0, 0, 0});
    fallen.outcome = outcome;
    EXPECT_TRUE(together(whole, fallen).ended);
    EXPECT_DOUBLE_EQ(together(whole, fallen).time, 0.2);
    EpisodeRow also_fallen = whole;
    also_fallen.outcome = Outcome::kFell;
    EXPECT_FALSE(together(also_fallen, fallen).ended);
    EpisodeRow cut_short = traced("mujoco", 0, {0, 0});  // timed out before the other fell
    cut_short.outcome = Outcome::kTimedOut;
    EXPECT_FALSE(together(cut_short, fallen).ended);
    EXPECT_DOUBLE_EQ(together(cut_short, fallen).time, 0.1);
  }
}

TEST(EngineParting, TracesThatCannotBeComparedAreNone) {
  const EpisodeRow a = traced("mujoco", 0, {0, 0});
  EpisodeRow b = a;
  b.trace.rate_hz = 20.0;
  EXPECT_FALSE(time_together(a, b, 0.05).has_value());
  b = a;
  b.trace.mm.clear();
  EXPECT_FALSE(time_together(a, b, 0.05).has_value());
  b = a;
  b.trace.points = {"head", "feet"};
  EXPECT_FALSE(time_together(a, b, 0.05).has_value());
}

TEST(EngineParting, QuartilesAreThoseOfKaplanAndMeier) {
  const std::vector<int> still(10, 0);
  const auto moved_at = [&](std::size_t frame) {
    std::vector<int> x = still;
    x[frame] = 80;
    return x;
  };
  // Parted after 0.3, 0.3 and 0.7 s, one seen for 0.4 s only: 1/2 left after 0.3 s, none after 0.7 s.
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 5; ++i) rows.push_back(traced("mujoco", i, still));
  rows.push_back(traced("ode", 0, moved_at(3)));
  rows.push_back(traced("ode", 1, moved_at(7)));
  rows.push_back(traced("ode", 2, std::vector<int>(5, 0)));
  rows.push_back(traced("ode", 3, moved_at(3)));
  rows.push_back(traced("ode", 4, {}));
  const Estimates parting = cross_engine(rows, {}, {.intervals = {.resamples = 200}}).parting;
  const auto of = [&](const char* name) { return *find_estimate(parting, {.name = name}); };
  EXPECT_EQ(of("parted").n, 4);
  EXPECT_EQ(of("parted").value, 3.0);
  EXPECT_EQ(of("without_trace").value, 1.0);
  EXPECT_DOUBLE_EQ(of("parting_lower_quartile").value, 0.3);
  EXPECT_DOUBLE_EQ(of("parting_median").value, 0.3);
  EXPECT_DOUBLE_EQ(of("parting_upper_quartile").value, 0.7);
}

}  // namespace
}  // namespace duet
