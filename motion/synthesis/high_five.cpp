// High-five: raise the hand beside the head, clap once or more, lower it.
#include <algorithm>
#include <cmath>

#include "motion/synthesis/act.h"

namespace duet::synthesis {
namespace {

constexpr double kRaise = 0.9;    // [s]
constexpr double kRebound = 0.4;  // back to where a clap starts [s]
constexpr double kPalm = 0.02;    // from the hand joint to the palm [m]

struct Clap {
  double strike, contact, away;  // start of the strike, first and last instant of contact [s]
};

std::vector<Clap> plan_claps(const Scene& scene, Draws& draws) {
  const double wait = draws.uniform("ready", 0.25, 0.6);
  const double strike = draws.styled("strike", 1.0 - scene.cast.style, 0.24, 0.36);
  const double contact = draws.uniform("contact", 0.10, 0.18);
  const double first = kRaise + scene.people[1].reaction;
  const double one = wait + strike + contact;
  const double room = scene.act_end - scene.act_begin - first;
  // The last clap ends the act; earlier ones come as far before it as they need.
  const int most = 1 + static_cast<int>(std::max(0.0, (room - one) / (one + kRebound)));
  const int wanted = draws.chance("claps.two", 0.35) ? 2 : 1;
  const int count = std::min({most, wanted, 2});
  draws.record("claps", count);
  std::vector<Clap> claps;
  for (int i = count - 1; i >= 0; --i) {
    const double away = scene.act_end - i * (one + kRebound);
    claps.push_back({away - contact - strike, away - contact, away});
  }
  return claps;
}

// The palm faces the partner: forearm upright, hand bent back.
const Eigen::Vector3d kPole(-0.15, 0.5, -1.0);
constexpr double kWrist = -0.35;

Hold ready_near(const Eigen::Vector3d& point) {
  return [=](const Moment& m) {
    ArmPose arm;
    arm.hand = point + 0.01 * m.sway;
    arm.pole = chest_vector(m, kPole);
    arm.wrist = kWrist;
    return arm;
  };
}

}  // namespace

Layout high_five_layout(const Cast& cast, Draws& draws) {
  const double stature = 0.5 * (cast.body[0].height + cast.body[1].height);
  const double shorter = std::min(cast.body[0].height, cast.body[1].height);
  const double high = draws.styled("target.share", cast.style, 0.86, 1.0);
  // The shorter one must get there without a jump.
  const double z = cast.target_height ? *cast.target_height : std::min(high * stature, 1.06 * shorter);
  draws.record("target_height", z);
  Lean lean;
  lean.forward = draws.styled("lean", cast.style, 0.02, 0.08);
  lean.twist = -side_sign(cast.side) * draws.uniform("twist", 0.05, 0.18);
  return meeting_layout(cast, z, draws.uniform("reach.share", 0.80, 0.88), 0.36, 0.60, lean);
}

void perform_high_five(Scene& scene, Draws& draws) {
  const int side = scene.cast.side;
  const std::vector<Clap> claps = plan_claps(scene, draws);
  const double back = draws.styled("swing", scene.cast.style, 0.14, 0.26);
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const Eigen::Vector3d meet = seen_by(k, scene.layout, scene.layout.meet);
    const Eigen::Vector3d contact = in_world(person.act, meet - Eigen::Vector3d(kPalm, 0.0, 0.0));
    const Eigen::Vector3d ready = in_world(person.act, meet + Eigen::Vector3d(-back, side_sign(side) * 0.08, -0.02));
    const Hold at_contact = at_point([=](double) { return contact; }, kPole, kWrist);
    ArmTrack& arm = person.arms[side];
    const double begin = scene.act_begin + person.reaction;
    arm.to(begin, begin + kRaise, ready_near(ready), {0.10, 0.05, 0.0});
    for (size_t i = 0; i < claps.size(); ++i) {
      arm.to(claps[i].strike, claps[i].contact, at_contact, {0.0, 0.0, 0.03});
      if (i + 1 < claps.size()) arm.to(claps[i].away, claps[i].away + kRebound, ready_near(ready));
    }
    arm.rest(scene.act_end, scene.release_end, {0.08, 0.06, 0.0});
    person.lean_to(begin, claps.front().contact, scene.layout.lean[k]);
    person.lean_to(scene.act_end, scene.release_end, {});
  }
  const int hand = sided(kLeftHand, side);
  for (const Clap& clap : claps) scene.touches.push_back({clap.contact, clap.away, hand, hand});
}

}  // namespace duet::synthesis
