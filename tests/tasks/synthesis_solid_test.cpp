#include <gtest/gtest.h>

#include "duet/motion/synthesis/synthesis.h"
#include "duet/robots/human_body.h"
#include "duet/tasks/synthesis/performer.h"
#include "duet/tasks/synthesis/posed_body.h"

namespace duet::synthesis {
namespace {

PosedBody standing(const Body& body) {
  PosedBody figure;
  pose_torso(body, standing_torso(body, {}, {}, body.stand_height), figure);
  for (const int side : {0, 1})
    pose_arm(body, {figure.p.col(sided(kLeftShoulder, side)) - Eigen::Vector3d(0.0, 0.0, 0.5)}, side, figure);
  return figure;
}

TEST(SolidParts, AreThoseOfTheSolidPartner) {
  const Body body = make_body(1.75, {});
  const PosedBody figure = standing(body);
  std::array<double, kSmplJoints> lengths{};
  for (int j = 1; j < kSmplJoints; ++j) lengths[j] = std::max(body.offset[j].norm(), 0.01);
  const HumanBody solid = make_human_body(lengths);
  int found = 0;
  for (const SolidPart& part : solid_parts(body, figure)) {
    for (const HumanCapsule& capsule : solid.capsules) {
      const auto ends = capsule.ends(figure.p);
      const bool same = (ends[0] - part.from).norm() < 1e-9 && (ends[1] - part.to).norm() < 1e-9;
      if (!same) continue;
      EXPECT_NEAR(capsule.radius, part.radius, 1e-9) << capsule.name;
      ++found;
    }
  }
  EXPECT_EQ(found, static_cast<int>(solid_parts(body, figure).size()));
  for (const HumanCapsule& capsule : solid.capsules) {
    if (capsule.name != "left_hand") continue;
    const SolidPart hand = solid_hand(body, figure, 0);
    EXPECT_LT((capsule.ends(figure.p)[0] - hand.from).norm(), 1e-9);
    EXPECT_LT((capsule.ends(figure.p)[1] - hand.to).norm(), 1e-9);
    EXPECT_NEAR(capsule.radius, hand.radius, 1e-9);
  }
}

TEST(SolidParts, OverlapIsDepthAndWayOut) {
  const SolidPart one{{0.0, 0.0, 0.0}, {0.0, 0.0, 1.0}, 0.1};
  const SolidPart other{{0.15, -1.0, 0.5}, {0.15, 1.0, 0.5}, 0.1};
  const Overlap overlap = overlap_of(one, other);
  EXPECT_NEAR(overlap.depth, 0.05, 1e-9);
  EXPECT_NEAR(overlap.out.x(), -1.0, 1e-6);
  EXPECT_LT(overlap_of(one, {{0.5, 0.0, 0.0}, {0.5, 0.0, 1.0}, 0.1}).depth, 0.0);
}

TEST(SolidParts, AHandThatWouldGoInsideStaysOutside) {
  const Body body = make_body(1.75, {});
  PosedBody own = standing(body), partner = standing(body);
  partner.p.row(0).array() += 0.45;
  const std::vector<SolidPart> parts = solid_parts(body, partner);
  const Eigen::Vector3d inside = partner.p.col(kSpine3);
  pose_arm(body, {.hand = inside}, 1, own);
  EXPECT_GT(overlap_of(solid_hand(body, own, 1), parts[2]).depth, 0.02);
  pose_arm_outside(body, {.hand = inside}, 1, parts, own);
  for (const SolidPart& part : parts) EXPECT_LT(overlap_of(solid_hand(body, own, 1), part).depth, 0.002);
}

// How deep a hand of one goes into head or trunk of the other, over a clip. [m]
double deepest_hand(const HumanMotion& one, const HumanMotion& other) {
  const HumanBody hands = make_human_body(bone_lengths(one)), solid = make_human_body(bone_lengths(other));
  double deepest = 0.0;
  for (int t = 0; t < one.frames(); ++t)
    for (const HumanCapsule& hand : hands.capsules) {
      if (hand.region != "hand") continue;
      const auto [from, to] = hand.ends(one.joints.frame(t));
      for (const HumanCapsule& part : solid.capsules) {
        const bool trunk = part.region == "head" || part.region == "neck" || part.region == "chest" ||
                           part.region == "abdomen" || part.region == "back" || part.region == "pelvis";
        if (!trunk) continue;
        const auto [a, b] = part.ends(other.joints.frame(t));
        deepest = std::max(deepest, overlap_of({from, to, hand.radius}, {a, b, part.radius}).depth);
      }
    }
  return deepest;
}

TEST(SolidParts, NoHandOfAHundredHugsLikePeopleIsInTheOther) {
  double deepest = 0.0;
  for (int index = 0; index < 100; ++index) {
    const InteractionClip clip =
        synthesize(Task::kHug, {.seed = 31, .index = index, .rate_hz = 30.0, .like = Likeness::kPeople});
    deepest = std::max({deepest, deepest_hand(clip.a, clip.b), deepest_hand(clip.b, clip.a)});
  }
  RecordProperty("deepest_mm", static_cast<int>(1000.0 * deepest));
  EXPECT_LE(deepest, 0.01);
}

}  // namespace
}  // namespace duet::synthesis
