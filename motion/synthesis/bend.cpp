// Bend: both bow to each other from the hips, hold it, come up again.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "motion/synthesis/act.h"

namespace duet::synthesis {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kHeadRoom = 0.38;  // between the two heads at the lowest [m]

Eigen::Vector3d head_from_root(const Body& body, const Lean& lean) {
  Figure figure;
  pose_torso(body, standing_torso(body, {}, lean, body.stand_height), figure);
  return figure.p.col(kHead) - figure.p.col(kPelvis);
}

// The lean at which the line from pelvis to head is inclined by `inclination`.
Lean bow_of(const Body& body, double inclination) {
  double low = 0.0, high = 0.75 * std::numbers::pi;
  Lean lean;
  for (int i = 0; i < 50; ++i) {
    lean.forward = 0.5 * (low + high);
    const Eigen::Vector3d v = head_from_root(body, lean);
    (std::atan2(v.x(), v.z()) < inclination ? low : high) = lean.forward;
  }
  return lean;
}

struct Bow {
  double begin, down, up, end;  // starts, is down, comes up, is up [s]
};

std::vector<Bow> plan_bows(double begin, double end, double down, double up, double hold) {
  constexpr double kBetween = 0.7, kLongestHold = 3.2;
  const double one = down + hold + up;
  const int count = end - begin >= 2.0 * one + kBetween && end - begin - one > kLongestHold ? 2 : 1;
  const double length = (end - begin - (count - 1) * kBetween) / count;
  std::vector<Bow> bows;
  for (int i = 0; i < count; ++i) {
    const double first = begin + i * (length + kBetween);
    bows.push_back({first, first + down, first + length - up, first + length});
  }
  return bows;
}

}  // namespace

Layout bend_layout(const Cast& cast, Draws& draws) {
  const double depth = draws.styled("inclination", cast.style, 33.0 * kDegree, 57.0 * kDegree);
  const double differs = draws.uniform("b.deeper", -4.0 * kDegree, 4.0 * kDegree);
  Layout layout;
  layout.distance = kHeadRoom;
  for (const int k : {0, 1}) {
    const double own = std::clamp(depth + (k == 1 ? differs : 0.0), 32.0 * kDegree, 58.0 * kDegree);
    draws.record(k == 0 ? "a.inclination" : "b.inclination", own);
    layout.lean[k] = bow_of(cast.body[k], own);
    layout.distance += head_from_root(cast.body[k], layout.lean[k]).x();
  }
  layout.distance = std::min(layout.distance + draws.uniform("act.room", 0.0, 0.5), cast.farthest);
  return layout;
}

void perform_bend(Scene& scene, Draws& draws) {
  const double down = draws.styled("down", 1.0 - scene.cast.style, 1.0, 1.5);
  const double up = draws.uniform("up", 1.1, 1.5);
  const double hold = draws.uniform("hold", 0.7, 1.4);
  const double later = draws.uniform("b.later", 0.0, 0.3) + scene.people[1].reaction;
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const double begin = scene.act_begin + k * later;
    const double end = scene.act_end - (1 - k) * later;
    for (const Bow& bow : plan_bows(begin, end, down, up, hold)) {
      person.lean_to(bow.begin, bow.down, scene.layout.lean[k]);
      person.lean_to(bow.up, bow.end, {});
      person.look.to(bow.begin, bow.down, 0.0);
      person.look.to(bow.up, bow.end, 1.0);
      person.nod.to(bow.begin, bow.down, 0.15);
      person.nod.to(bow.up, bow.end, 0.0);
    }
  }
}

}  // namespace duet::synthesis
