#include <gtest/gtest.h>

#include <cmath>

#include "duet/experiment/plan/episode.h"

namespace duet {
namespace {

// A second of motion.
PairedMotion second_long() {
  PairedMotion motion;
  motion.robot.rate_hz = 50.0;
  motion.robot.root.resize(50);
  motion.robot.q.resize(29, 50);
  return motion;
}

TEST(EpisodeCosts, TheWorkLeftIsThatOfEachEngineAtItsOwnCost) {
  const PairedMotion clip = second_long();
  const SuiteController vmc{"vmc"};
  EpisodeSpec quick, slow;
  for (EpisodeSpec* spec : {&quick, &slow}) {
    spec->clip = &clip;
    spec->controller = &vmc;
    spec->engine = spec == &quick ? "playback" : "mujoco";
  }
  EpisodeCosts costs;
  EXPECT_TRUE(std::isnan(costs.share_done()));
  for (int i = 0; i < 4; ++i) costs.expect(quick);
  for (int i = 0; i < 2; ++i) costs.expect(slow);
  for (int i = 0; i < 3; ++i) costs.ended(quick, 0.1);
  EXPECT_TRUE(std::isnan(costs.share_done())) << "nobody knows yet what an episode of mujoco costs";
  costs.ended(slow, 2.0);
  EXPECT_DOUBLE_EQ(costs.share_done(), 2.3 / (2.3 + 0.1 + 2.0));
  costs.ended(quick, 0.1);
  costs.ended(slow, 4.0);
  EXPECT_EQ(costs.share_done(), 1.0);
}

TEST(EpisodeCosts, AreToldApartByEngineAndController) {
  const SuiteController pd{"pd"};
  EpisodeSpec spec;
  spec.engine = "ode";
  spec.controller = &pd;
  EXPECT_EQ(cost_name(spec), "ode/pd");
}

}  // namespace
}  // namespace duet
