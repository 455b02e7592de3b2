#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "duet/motion/synthesis/stage.h"
#include "duet/tasks/synthesis/posed_body.h"

namespace duet::synthesis {
namespace {

using Eigen::Vector3d;

constexpr double kStanceSway = 0.006;   // of the pelvis [m]
constexpr double kTrunkSway = 0.008;    // [rad]
constexpr double kWeightShift = 0.022;  // of the pelvis over the standing foot [m]
constexpr double kPelvisDrop = 0.035;   // on the side of the swinging leg [rad]
constexpr double kPelvisTurn = 0.16;    // per metre between the feet [rad/m]
constexpr double kCounterTurn = 1.7;    // of the spine, per turn of the pelvis
constexpr double kHeightWindow = 0.14;  // half width of the smoothing of the pelvis' height [s]
constexpr double kFarthestLook = 1.0;   // [rad]

// How far the left foot is ahead of the right one, in the direction the person faces. [m]
double left_ahead(const Performer& person, double t, double yaw) {
  const Vector3d apart = person.gait.foot(0, t).toe - person.gait.foot(1, t).toe;
  return apart.x() * std::cos(yaw) + apart.y() * std::sin(yaw);
}

void turn_head(const Performer& person, const Performer& partner, double t, TorsoPose& torso) {
  const Placement there = partner.gait.root(t);
  const Eigen::Vector2d away = there.position - torso.pelvis.head<2>();
  const double chest_yaw = torso.yaw + torso.pelvis_yaw + torso.twist;
  const double aside = turn_between(chest_yaw, std::atan2(away.y(), away.x()));
  const double down = std::atan2(0.9 * (person.body.height - partner.body.height), std::max(away.norm(), 0.3));
  const double weight = person.look.at(t);
  // Nobody looks back over the shoulder at someone straight behind: the turn fades out towards the back.
  const double turned = kFarthestLook * std::tanh(aside / kFarthestLook) * std::pow(std::cos(0.5 * aside), 2);
  torso.look_yaw = weight * turned + 0.05 * person.sway[5].at(t);
  torso.look_pitch = weight * 0.6 * std::clamp(down, -0.5, 0.5) + person.nod.at(t) + 0.03 * person.sway[6].at(t) -
                     0.5 * weight * (torso.pelvis_pitch + torso.spine_bend);
}

// The trunk with the pelvis at height 0.
TorsoPose torso_at(const Performer& person, const Performer& partner, double t) {
  const Placement root = person.gait.root(t);
  const double weight = person.gait.weight(t);
  const double walking = 0.02 * weight * weight;
  const Lean lean = {person.forward.at(t) + walking + kTrunkSway * person.sway[2].at(t),
                     person.side.at(t) + kTrunkSway * person.sway[3].at(t),
                     person.twist.at(t),
                     0.0,
                     person.shift.at(t) + kStanceSway * person.sway[0].at(t),
                     person.hips.at(t)};
  TorsoPose torso = standing_torso(person.body, root, lean, 0.0);
  if (person.aside != 0.0) {
    torso.pelvis_yaw += person.aside;
    torso.twist -= person.aside;
  }
  if (person.stoop != 0.0) torso.spine_bend += person.stoop;
  const double aside = kWeightShift * weight + 1.5 * kStanceSway * person.sway[1].at(t);
  torso.pelvis.head<2>() += aside * Eigen::Vector2d(-std::sin(root.yaw), std::cos(root.yaw));
  torso.pelvis_roll = kPelvisDrop * weight;
  const double swing = -kPelvisTurn * left_ahead(person, t, root.yaw) + 0.01 * person.sway[4].at(t);
  torso.pelvis_yaw += swing;
  torso.twist -= kCounterTurn * swing;
  turn_head(person, partner, t, torso);
  return torso;
}

// Highest pelvis that both legs and the crouch allow.
double highest_pelvis(const Performer& person, const TorsoPose& torso_at_zero, double t) {
  PosedBody figure;
  pose_torso(person.body, torso_at_zero, figure);
  const double reach = kLegReach * person.body.leg();
  double highest = person.body.stand_height - person.crouch.at(t);
  for (const int side : {0, 1}) {
    const Vector3d hip = figure.p.col(sided(kLeftHip, side));
    const Vector3d ankle = ankle_of(person.body, person.gait.foot(side, t), side);
    const double across = (hip - ankle).head<2>().norm();
    highest = std::min(highest, ankle.z() + std::sqrt(std::max(reach * reach - across * across, 0.0)) - hip.z());
  }
  return highest;
}

// Nowhere above `limit`, and smooth: least value in a window, then a weighted mean over the same window.
std::vector<double> smooth_below(const std::vector<double>& limit, int half) {
  const int n = static_cast<int>(limit.size());
  std::vector<double> least(n), smooth(n, 0.0), weights;
  double sum = 0.0;
  for (int k = -half; k <= half; ++k) {
    const double x = static_cast<double>(k) / (half + 1);
    weights.push_back(std::pow(1.0 - x * x, 3));
    sum += weights.back();
  }
  for (int t = 0; t < n; ++t)
    least[t] = *std::min_element(limit.begin() + std::max(t - half, 0), limit.begin() + std::min(t + half, n - 1) + 1);
  for (int t = 0; t < n; ++t)
    for (int k = -half; k <= half; ++k) smooth[t] += weights[k + half] / sum * least[std::clamp(t + k, 0, n - 1)];
  return smooth;
}

std::vector<TorsoPose> pose_torsos(const Performer& person, const Performer& partner, int frames, double rate_hz,
                                   const RenderOptions& showing) {
  std::vector<TorsoPose> torsos(frames);
  std::vector<double> limit(frames);
  for (int i = 0; i < frames; ++i) {
    const double t = showing.first + showing.tempo * (i / rate_hz);
    torsos[i] = torso_at(person, partner, t);
    limit[i] = highest_pelvis(person, torsos[i], t);
  }
  const int half = std::max(1, static_cast<int>(std::lround(kHeightWindow / showing.tempo * rate_hz)));
  const std::vector<double> heights = smooth_below(limit, half);
  for (int i = 0; i < frames; ++i) torsos[i].pelvis.z() = heights[i];
  return torsos;
}

// Reads no more of the partner than the torso.
void pose_limbs(const Performer& person, const Body& partner_body, const PosedBody& partner, double t, PosedBody& own) {
  // Arms swing against the legs: the left one goes forward with the right foot.
  const double ahead = left_ahead(person, t, own.yaw);
  const double stride = person.arm_swing * std::atan(ahead / (2.0 * person.body.leg()));
  for (const int side : {0, 1}) {
    const int first = side == 0 ? 6 : 9;
    const Vector3d sway(person.sway[first].at(t), person.sway[first + 1].at(t), person.sway[first + 2].at(t));
    const Moment moment{t, side, person.body, own, partner, -side_sign(side) * stride, sway};
    const ArmPose arm = person.arms[side].at(moment);
    pose_leg(person.body, person.gait.foot(side, t), side, own);
    if (person.meets_skin)
      pose_arm_outside(person.body, arm, side, solid_parts(partner_body, partner), own);
    else
      pose_arm(person.body, arm, side, own);
  }
}

void store(const PosedBody& figure, int frame, HumanMotion& motion) {
  motion.joints.frame(frame) = figure.p;
  for (const Eigen::Matrix3d& rotation : figure.R)
    motion.rotations.push_back(Eigen::Quaterniond(rotation).normalized());
}

}  // namespace

std::array<HumanMotion, 2> render(const std::array<Performer, 2>& people, int frames, double rate_hz,
                                  const RenderOptions& showing) {
  std::array<HumanMotion, 2> motions;
  std::array<std::vector<TorsoPose>, 2> torsos;
  for (const int k : {0, 1}) {
    motions[k].rate_hz = rate_hz;
    motions[k].joints = PointTracks(frames, kSmplJoints);
    motions[k].rotations.reserve(static_cast<size_t>(frames) * kSmplJoints);
    torsos[k] = pose_torsos(people[k], people[1 - k], frames, rate_hz, showing);
  }
  for (int i = 0; i < frames; ++i) {
    std::array<PosedBody, 2> figures;
    for (const int k : {0, 1}) pose_torso(people[k].body, torsos[k][i], figures[k]);
    for (const int k : {0, 1}) {
      pose_limbs(people[k], people[1 - k].body, figures[1 - k], showing.first + showing.tempo * (i / rate_hz),
                 figures[k]);
      store(figures[k], i, motions[k]);
    }
  }
  return motions;
}

}  // namespace duet::synthesis
