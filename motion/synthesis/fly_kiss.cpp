// Fly-kiss: hand to the mouth, then out towards the partner, who may catch it first and sends one back.
#include <algorithm>
#include <cmath>

#include "motion/synthesis/act.h"

namespace duet::synthesis {
namespace {

constexpr double kToMouth = 0.8, kForward = 0.75;                                // [s]
constexpr double kCatch = 0.65, kCaught = 0.25, kToHeart = 0.6, kAtHeart = 0.5;  // [s]

// Fingertips at the lips, so the knuckles are in front of the chin.
Hold at_mouth() {
  return [](const Moment& m) {
    const double h = m.body.height;
    ArmPose arm;
    arm.hand = m.own.p.col(kHead) +
               m.own.R[kHead] * Eigen::Vector3d(0.068 * h, side_sign(m.side) * 0.022 * h, -0.045 * h) + 0.004 * m.sway;
    arm.pole = chest_vector(m, {-0.1, 0.9, -1.0});
    arm.wrist = 0.45;
    return arm;
  };
}

Hold at_heart() {
  return [](const Moment& m) {
    const double h = m.body.height;
    ArmPose arm;
    arm.hand = m.own.p.col(kSpine3) + chest_vector(m, {0.095 * h, 0.02 * h, 0.03 * h}) + 0.004 * m.sway;
    arm.pole = chest_vector(m, {-0.2, 0.9, -1.0});
    arm.wrist = 0.4;
    return arm;
  };
}

// Palm up, arm nearly stretched towards the partner, at `height` above the ground.
Hold blown(double height) {
  return [=](const Moment& m) {
    const double share = 0.84;
    const Eigen::Vector3d shoulder = m.own.p.col(sided(kLeftShoulder, m.side));
    const double up = height - shoulder.z();
    const double level = std::sqrt(std::max(std::pow(share * m.body.arm(), 2) - up * up, 0.04));
    const Eigen::Vector3d ahead = chest_vector(m, {1.0, -0.15, 0.0});
    ArmPose arm;
    arm.hand = shoulder + level * ahead.normalized() + 0.007 * m.sway;
    arm.hand.z() = height + 0.007 * m.sway.z();
    arm.pole = chest_vector(m, {-0.3, 0.5, -1.0});
    arm.wrist = -0.25;
    return arm;
  };
}

}  // namespace

Layout fly_kiss_layout(const Cast& cast, Draws& draws) {
  Layout layout;
  layout.distance = std::min(draws.uniform("act.distance", 1.2, 2.1), cast.farthest);
  for (Lean& lean : layout.lean) lean.forward = draws.styled("lean", cast.style, 0.02, 0.12);
  return layout;
}

void perform_fly_kiss(Scene& scene, Draws& draws) {
  const int side = scene.cast.side;
  const double lips = draws.uniform("lips", 0.4, 0.9);
  const double kiss = kToMouth + lips + kForward;
  const double catching = kCatch + kCaught + kToHeart + kAtHeart;
  const double shown = 0.6;  // the hand stays out at least this long [s]
  const double notice = kToMouth + lips + 0.4 * kForward + scene.people[1].reaction;
  const double room = scene.act_end - scene.act_begin - notice - kiss - shown;
  const bool catches = draws.chance("b.catches", 0.5) && room >= catching;
  draws.record("b.catches", catches ? "yes" : "no");
  const double release = scene.release_end - scene.act_end;
  const double high = draws.styled("target.share", scene.cast.style, 0.76, 0.86);
  const double longest_show = draws.uniform("shown", 0.8, 1.8);
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    ArmTrack& arm = person.arms[side];
    const double height = scene.cast.target_height.value_or(high * person.body.height);
    draws.record(k == 0 ? "a.target_height" : "b.target_height", height);
    double t = k == 0 ? scene.act_begin : scene.act_end - kiss - std::clamp(room, shown, longest_show);
    if (k == 1 && catches) {
      const double start = t - catching;
      arm.to(start, start + kCatch, blown(0.78 * person.body.height), {0.0, 0.05, 0.05});
      arm.to(start + kCatch + kCaught, start + kCatch + kCaught + kToHeart, at_heart());
    }
    arm.to(t, t + kToMouth, at_mouth(), {0.12, 0.04, 0.0});
    arm.to(t + kToMouth + lips, t + kiss, blown(height), {0.0, 0.0, -0.03});
    person.lean_to(t + kToMouth + lips, t + kiss, scene.layout.lean[k]);
    const double back = k == 0 ? t + kiss + longest_show : scene.act_end;
    arm.rest(back, back + release, {0.08, 0.05, 0.0});
    person.lean_to(back, back + release, {});
  }
}

}  // namespace duet::synthesis
