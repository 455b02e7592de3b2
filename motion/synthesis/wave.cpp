// Wave: one raises a hand and waves, the other notices and answers.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "motion/synthesis/act.h"

namespace duet::synthesis {
namespace {

constexpr double kRaise = 0.8;        // [s]
constexpr double kFastestHand = 2.4;  // at the middle of a stroke [m/s]

struct Waving {
  double amplitude;  // half of the stroke [m]
  double height;     // of the hand above the ground [m]
  Burst strokes;
};

// The hand swings about the elbow: lowest at either end of the stroke, a little forward towards the middle of the body.
Hold waving_hand(const Waving& waving) {
  return [=](const Moment& m) {
    const double stroke = waving.amplitude * waving.strokes.at(m.t);
    const Eigen::Vector3d shoulder = m.own.p.col(sided(kLeftShoulder, m.side));
    const Eigen::Vector3d offset(0.36 * m.body.arm() - 0.2 * stroke, 0.26 * m.body.arm() + stroke, 0.0);
    ArmPose arm;
    arm.hand = shoulder + chest_vector(m, offset) + 0.006 * m.sway;
    arm.hand.z() = waving.height + 0.006 * m.sway.z() - 1.6 * stroke * stroke;
    arm.pole = chest_vector(m, {-0.2, 0.5, -1.0});
    arm.wrist = -0.1;
    return arm;
  };
}

}  // namespace

Layout wave_layout(const Cast& cast, Draws& draws) {
  Layout layout;
  layout.distance = std::min(draws.uniform("act.distance", 1.2, 2.2), cast.farthest);
  return layout;
}

void perform_wave(Scene& scene, Draws& draws) {
  const int side = scene.cast.side;
  const double length = scene.act_end - scene.act_begin;
  const double notice = draws.uniform("notice", 0.3, 0.8);
  const double stop = draws.uniform("a.stop", 0.72, 0.9);
  const std::array<double, 2> begin = {scene.act_begin, scene.act_begin + notice + scene.people[1].reaction};
  const std::array<double, 2> end = {scene.act_begin + stop * length, scene.act_end};
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const std::string who(kWho[k]);
    const double rate = draws.uniform(who + "wave.rate_hz", 1.7, 2.4);
    const double usual = draws.styled(who + "wave.amplitude", scene.cast.style, 0.12, 0.20);
    const double high = draws.styled(who + "wave.share", scene.cast.style, 0.87, 1.02);
    Waving waving;
    waving.amplitude = std::min(usual, kFastestHand / (2.0 * std::numbers::pi * rate));
    waving.height = scene.cast.target_height.value_or(high * person.body.height);
    waving.strokes = {begin[k] + 0.75 * kRaise, end[k], rate, 0.35};
    draws.record(who + "target_height", waving.height);
    person.arms[side].to(begin[k], begin[k] + kRaise, waving_hand(waving), {0.08, 0.06, 0.0});
    person.arms[side].rest(end[k], end[k] + scene.release_end - scene.act_end, {0.08, 0.05, 0.0});
  }
}

}  // namespace duet::synthesis
