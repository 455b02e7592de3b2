// Hug: arms open on the last steps, one over and one under the partner's arms (the taller one's over where statures
// differ much), hands on the back, perhaps a pat, then apart.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "motion/synthesis/act.h"

namespace duet::synthesis {
namespace {

constexpr double kOpen = 0.9;         // arms open this long before the act [s]
constexpr double kWrap = 1.15;        // [s]
constexpr double kSkin = 0.025;       // hand joint above the surface of the torso [m]
constexpr double kStatureGap = 0.13;  // from here on the taller one's arms both go over [m]
constexpr std::array<SmplJoint, 3> kBackJoints = {kSpine1, kSpine2, kSpine3};

// Where a hand lies on the partner's back, relative to a joint of the partner's spine (that joint's axes).
struct Spot {
  SmplJoint joint = kSpine3;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  bool over = false;
};

bool goes_over(const Cast& cast, int person, int arm) {
  const double taller = cast.body[person].height - cast.body[1 - person].height;
  if (std::abs(taller) > kStatureGap) return taller > 0.0;
  return arm == cast.side;
}

Figure embracing(const Cast& cast, const Layout& layout, int person) {
  Figure figure;
  const Body& body = cast.body[person];
  pose_torso(body, standing_torso(body, {}, layout.lean[person], body.stand_height), figure);
  return figure;
}

Spot spot_for(const Cast& cast, const Layout& layout, int person, int arm, Draws& draws) {
  const Figure own = embracing(cast, layout, person), partner = embracing(cast, layout, 1 - person);
  Spot spot;
  spot.over = goes_over(cast, person, arm);
  const std::string name = fmt::format("{}{}.spot", kWho[person], arm == 0 ? "left" : "right");
  const double below = draws.uniform(name + ".below", spot.over ? 0.10 : 0.12, spot.over ? 0.16 : 0.2);
  const double wanted = cast.target_height ? *cast.target_height + (spot.over ? 0.03 : -0.03)
                                           : own.p(2, sided(kLeftShoulder, arm)) - below;
  const double z = std::clamp(wanted, partner.p(2, kSpine1) - 0.03, partner.p(2, kSpine3) + 0.09);
  for (const SmplJoint joint : kBackJoints)
    if (std::abs(z - partner.p(2, joint)) < std::abs(z - partner.p(2, spot.joint))) spot.joint = joint;
  // My left arm comes round the partner's right side.
  const double entry = -side_sign(arm);
  spot.offset = {-(cast.body[1 - person].torso_radius + kSkin), entry * draws.uniform(name + ".aside", 0.01, 0.06),
                 z - partner.p(2, spot.joint)};
  return spot;
}

Hold on_back(const Spot& spot, const std::vector<Burst>& pats, double lift) {
  return [=](const Moment& m) {
    double pat = 0.0;
    for (const Burst& burst : pats) pat += std::pow(burst.at(m.t), 2);
    const Eigen::Vector3d offset = spot.offset - Eigen::Vector3d(lift * pat, 0.0, 0.0);
    ArmPose arm;
    arm.hand = m.partner.p.col(spot.joint) + m.partner.R[spot.joint] * offset;
    arm.pole = chest_vector(m, spot.over ? Eigen::Vector3d(0.1, 1.0, 0.35) : Eigen::Vector3d(-0.1, 1.0, -0.55));
    arm.wrist = 0.35;
    return arm;
  };
}

Hold open_arm(bool over, double width) {
  return from_shoulder({0.62, width, over ? 0.02 : -0.34}, {-0.3, 0.8, over ? -0.3 : -0.8}, 0.15);
}

std::vector<Burst> plan_pats(const std::string& who, double begin, double end, Draws& draws) {
  if (!draws.chance(who + "pats", 0.4)) return {};
  const double start = draws.stream(who + "pats.start").uniform(begin, std::max(begin, end - 2.0));
  return {{start, std::min(start + 1.8, end), 0.9, 0.4}};
}

}  // namespace

Layout hug_layout(const Cast& cast, Draws& draws) {
  Layout layout;
  const double lean = draws.styled("lean", cast.style, 0.08, 0.17);
  const double gap = draws.uniform("gap", 0.01, 0.05);
  const double aside = draws.uniform("aside", 0.045, 0.07);
  // Each stands a little to the side of the arm that goes over, so that the heads pass each other.
  layout.lateral = -side_sign(cast.side) * 2.0 * aside;
  layout.distance = gap;
  for (const int k : {0, 1}) {
    layout.lean[k].forward = lean;
    layout.lean[k].side = -side_sign(cast.side) * 0.05;
    layout.distance += cast.body[k].torso_radius + embracing(cast, layout, k).p(0, kSpine3);
  }
  return layout;
}

void perform_hug(Scene& scene, Draws& draws) {
  const double width = draws.styled("open.width", scene.cast.style, 0.10, 0.32);
  const double lift = draws.uniform("pat.lift", 0.015, 0.03);
  const double closed = scene.act_begin + kWrap + scene.people[1].reaction;
  const double free = scene.act_end + 0.55;
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const std::string who(kWho[k]);
    const double wrap = scene.act_begin + person.reaction;
    person.lean_to(wrap, wrap + kWrap, scene.layout.lean[k]);
    person.lean_to(scene.act_end + 0.2, scene.release_end - 0.1, {});
    const std::vector<Burst> pats = plan_pats(who, closed + 0.3, scene.act_end - 0.1, draws);
    for (const int arm : {0, 1}) {
      const Spot spot = spot_for(scene.cast, scene.layout, k, arm, draws);
      const bool pats_here = arm == scene.cast.side;
      const Eigen::Vector3d round(0.06, spot.over ? 0.14 : 0.17, spot.over ? 0.10 : -0.02);
      ArmTrack& track = person.arms[arm];
      const Hold open = open_arm(spot.over, width);
      track.to(wrap - kOpen, wrap, open, {0.02, 0.05, 0.0});
      track.to(wrap, wrap + kWrap, on_back(spot, pats_here ? pats : std::vector<Burst>{}, lift), round);
      track.to(scene.act_end, free, open, round);
      track.rest(free, scene.release_end, {0.0, 0.05, 0.0});
      const int hand = sided(kLeftHand, arm);
      scene.touches.push_back({closed, scene.act_end, k == 0 ? hand : spot.joint, k == 0 ? spot.joint : hand});
    }
  }
}

}  // namespace duet::synthesis
