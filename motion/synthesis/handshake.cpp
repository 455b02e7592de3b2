// Handshake: both reach out, clasp at waist height, shake in bouts, hold, let go.
#include <algorithm>
#include <cmath>

#include "motion/synthesis/act.h"

namespace duet::synthesis {
namespace {

constexpr double kReach = 1.0;  // from the first movement to the clasp [s]
// Clasped hands pass each other: each hand joint is this far beyond the middle and to its own side. [m]
constexpr double kOverlap = 0.010, kAside = 0.012;

std::vector<Burst> shake_bouts(double begin, double end, Draws& draws) {
  const double rate = draws.uniform("shake.rate_hz", 1.6, 2.4);
  Random random = draws.stream("shake.bouts");
  std::vector<Burst> bouts;
  double t = begin + random.uniform(0.1, 0.3);
  while (t < end) {
    const double length = (3 + random.below(3)) / rate;
    if (t + length > end) break;
    bouts.push_back({t, t + length, rate, 0.35 / rate});
    t += length + random.uniform(0.6, 1.6);
  }
  draws.record("shake.bouts", static_cast<double>(bouts.size()));
  return bouts;
}

}  // namespace

Layout handshake_layout(const Cast& cast, Draws& draws) {
  const double stature = 0.5 * (cast.body[0].height + cast.body[1].height);
  const double z = cast.target_height ? *cast.target_height : stature * draws.uniform("target.share", 0.565, 0.62);
  draws.record("target_height", z);
  const double share = draws.uniform("reach.share", 0.80, 0.87);
  Lean lean;
  lean.forward = draws.styled("lean", cast.style, 0.03, 0.12);
  lean.twist = -side_sign(cast.side) * draws.uniform("twist", 0.10, 0.22);
  // At least 0.45 m: closer, a hand is at the own belly.
  return meeting_layout(cast, z, share, 0.45, 0.62, lean);
}

void perform_handshake(Scene& scene, Draws& draws) {
  const double clasp = scene.act_begin + kReach;
  const double amplitude = draws.styled("shake.amplitude", scene.cast.style, 0.018, 0.045);
  const std::vector<Burst> bouts = shake_bouts(clasp, scene.act_end - 0.2, draws);
  const int side = scene.cast.side;
  const Eigen::Vector3d middle = in_world(scene.people[0].act, scene.layout.meet);
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const Eigen::Vector3d beyond = rot_z(person.act.yaw) * Eigen::Vector3d(kOverlap, side_sign(side) * kAside, 0.0);
    const auto point = [=](double t) {
      double shake = 0.0;
      for (const Burst& bout : bouts) shake += bout.at(t);
      return Eigen::Vector3d(middle + beyond + Eigen::Vector3d(0.0, 0.0, amplitude * shake));
    };
    const double begin = scene.act_begin + person.reaction;
    person.lean_to(begin, clasp, scene.layout.lean[k]);
    person.arms[side].to(begin, clasp, at_point(point, {-0.4, 0.45, -1.0}, 0.05), {0.02, 0.04, 0.02});
    person.arms[side].rest(scene.act_end, scene.release_end);
    person.lean_to(scene.act_end, scene.release_end, {});
  }
  const int hand = sided(kLeftHand, side);
  scene.touches.push_back({clasp, scene.act_end, hand, hand});
}

}  // namespace duet::synthesis
