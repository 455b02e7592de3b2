#include "duet/policies/scheduler.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::kAlgebra;
using test::random_anchors;

TEST(Densify, GivesAHundredReferencesOnTheGrid) {
  Random random(1, 1);
  EXPECT_EQ(densify(random_anchors(random, 29)).size(), 100u);
}

TEST(Densify, MeetsTheFirstFourAnchorsToTheBit) {
  Random random(1, 1);
  const Anchors anchors = random_anchors(random, 29);
  const std::vector<Reference> dense = densify(anchors);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(dense[25 * i].q, anchors[i].q);
    EXPECT_EQ(dense[25 * i].X_WB.p, anchors[i].X_WB.p);
    EXPECT_EQ(dense[25 * i].X_WB.R.coeffs(), anchors[i].X_WB.R.coeffs());
  }
}

TEST(Densify, HeadsForTheLastAnchorWhichTheGridDoesNotReach) {
  Random random(1, 1);
  const Anchors anchors = random_anchors(random, 5);
  const Reference last = densify(anchors).back();  // 1.98 s: 24/25 of the way
  EXPECT_NEAR((last.q - (anchors[3].q + 0.96 * (anchors[4].q - anchors[3].q))).norm(), 0.0, kAlgebra);
}

TEST(Densify, IsLinearInPositionsAndJointsAndTurnsEvenlyBetweenAnchors) {
  Random random(2, 1);
  const std::vector<Reference> dense = densify(random_anchors(random, 7));
  for (std::size_t i = 1; i + 1 < dense.size(); ++i) {
    if (i % 25 == 0) continue;  // a kink is allowed at an anchor
    EXPECT_NEAR((dense[i - 1].q - 2.0 * dense[i].q + dense[i + 1].q).norm(), 0.0, kAlgebra);
    EXPECT_NEAR((dense[i - 1].X_WB.p - 2.0 * dense[i].X_WB.p + dense[i + 1].X_WB.p).norm(), 0.0, kAlgebra);
    const Eigen::Quaterniond before = dense[i - 1].X_WB.R.conjugate() * dense[i].X_WB.R;
    const Eigen::Quaterniond after = dense[i].X_WB.R.conjugate() * dense[i + 1].X_WB.R;
    EXPECT_NEAR(before.angularDistance(after), 0.0, 1e-7);  // arccos near 1: sqrt(epsilon)
  }
}

TEST(Densify, TurnsOverTheShorterArc) {
  Random random(3, 1);
  Anchors anchors = random_anchors(random, 1);
  for (Reference& anchor : anchors) anchor.X_WB.R = Eigen::Quaterniond::Identity();
  anchors[1].X_WB.R = Eigen::Quaterniond(-yaw_rotation(1.0).coeffs());  // the same rotation, the other sign
  const std::vector<Reference> dense = densify(anchors);
  for (int i = 0; i <= 25; ++i) EXPECT_NEAR(yaw_of(dense[static_cast<std::size_t>(i)].X_WB.R), i / 25.0, kAlgebra);
}

}  // namespace
}  // namespace duet
