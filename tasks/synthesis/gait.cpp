#include "duet/tasks/synthesis/gait.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/require.h"
#include "duet/tasks/synthesis/curves.h"

namespace duet::synthesis {
namespace {

constexpr double kSwingShare = 0.86;   // of the step time a foot is in the air
constexpr double kHasty = 0.46;        // least time of a step [s]
constexpr double kLongestStep = 0.74;  // in lengths of the leg
constexpr double kRollShare = 0.22;    // of the step time the heel rises before the toe leaves

Eigen::Vector2d rotated(double yaw, const Eigen::Vector2d& v) { return Eigen::Rotation2Dd(yaw) * v; }

FootPose swinging(const Swing& swing, double t, double toe_length) {
  const double duration = swing.land - swing.lift;
  const double u = (t - swing.lift) / duration;
  const double early = swing.roll_time / duration;
  const double heel_up = swing.roll * pulse((u + early) / (0.75 + early));
  const double toe_up = 0.25 * swing.roll * pulse((u - 0.5) / 0.5);
  const double s = glide(u);
  FootPose foot;
  foot.toe = swing.from.toe + s * (swing.to.toe - swing.from.toe);
  foot.toe.z() += swing.clearance * pulse(u) + toe_length * std::sin(toe_up);
  foot.yaw = swing.from.yaw + s * turn_between(swing.from.yaw, swing.to.yaw);
  foot.pitch = heel_up - toe_up;
  return foot;
}

}  // namespace

double turn_between(double from, double to) { return std::remainder(to - from, 2.0 * std::numbers::pi); }

Placement Walk::at(double t) const {
  const double u = std::clamp((t - begin) / (end - begin), 0.0, 1.0);
  const double s = glide((u - moves_from) / (1.0 - moves_from));
  Placement here;
  here.position = from.position + s * (to.position - from.position) + 4.0 * s * (1.0 - s) * bulge;
  here.yaw = from.yaw + (to.yaw - from.yaw) * (turned_by < 1.0 ? ramp(u / turned_by) : s);
  return here;
}

Placement Walk::footfall(int i) const {
  if (i >= steps - 2) return to;
  // From landing until this foot's next swing; the root passes over the foot in the middle.
  const double step = step_time();
  return at(begin + (i + 0.5 * (1.0 + kSwingShare) + 0.5 * (2.0 - kSwingShare)) * step);
}

Gait::Gait(const Body& body, const Placement& start)
    : half_width_(0.052 * body.height),
      ankle_back_(0.022 * body.height),
      toe_out_(0.1),
      leg_(body.leg()),
      toe_offset_(body.offset[kLeftToe]),
      toe_height_(body.toe_height()),
      start_(start) {
  for (const int side : {0, 1}) first_[side] = standing_[side] = planted(start, side);
}

FootPose Gait::planted(const Placement& root, int side) const {
  const double sign = side_sign(side);
  FootPose foot;
  foot.yaw = root.yaw + sign * toe_out_;
  const Eigen::Vector2d ankle = root.position + rotated(root.yaw, {-ankle_back_, sign * half_width_});
  const Eigen::Vector2d toe = ankle + rotated(foot.yaw, toe_offset_.head<2>());
  foot.toe = {toe.x(), toe.y(), toe_height_};
  return foot;
}

void Gait::walk(const Walk& walk) {
  require(walk.steps >= 2 && walk.end > walk.begin && (walks_.empty() || walk.begin >= walks_.back().end),
          "synthesis gait: a walk overlaps the one before it or has fewer than two steps");
  const double step = walk.step_time();
  for (int i = 0; i < walk.steps; ++i) {
    Swing swing;
    swing.foot = (walk.first_foot + i) % 2;
    swing.lift = walk.begin + i * step + 0.5 * (1.0 - kSwingShare) * step;
    swing.land = swing.lift + kSwingShare * step;
    swing.roll_time = kRollShare * step;
    swing.from = standing_[swing.foot];
    swing.to = planted(walk.footfall(i), swing.foot);
    const Eigen::Vector3d travel = swing.to.toe - swing.from.toe;
    const double forward = travel.head<2>().dot(rotated(swing.from.yaw, {1.0, 0.0}));
    swing.roll = 0.12 + 0.75 * std::clamp(forward / (2.0 * leg_), 0.0, 0.8);
    swing.clearance = 0.025 + 0.04 * std::min(travel.norm(), 1.0);
    standing_[swing.foot] = swing.to;
    swings_.push_back(swing);
  }
  walks_.push_back(walk);
}

Placement Gait::root(double t) const {
  const Walk* current = nullptr;
  for (const Walk& walk : walks_)
    if (t > walk.begin) current = &walk;
  return current != nullptr ? current->at(t) : start_;
}

FootPose Gait::foot(int side, double t) const {
  FootPose foot = first_[side];
  for (const Swing& swing : swings_) {
    if (swing.foot != side) continue;
    if (t <= swing.lift - swing.roll_time) break;
    foot = t < swing.land ? swinging(swing, t, toe_offset_.head<2>().norm()) : swing.to;
  }
  return foot;
}

double Gait::weight(double t) const {
  double value = 0.0;
  for (const Swing& swing : swings_) {
    const double early = 0.25 * (swing.land - swing.lift);
    value -= side_sign(swing.foot) * pulse((t - swing.lift + early) / (swing.land - swing.lift + 2.0 * early));
  }
  return value;
}

double step_length(const Body& body, double speed) {
  constexpr double kWalkRatio = 0.0065;  // [m / (steps / min)]
  constexpr double kMeanLeg = 0.84;      // thigh + shank of the adults behind that figure [m]
  return std::sqrt(60.0 * kWalkRatio * speed) * body.leg() / kMeanLeg;
}

void choose_steps(const Body& body, double speed, Walk& walk) {
  constexpr double kMostTurn = 0.3 * std::numbers::pi;
  const double usual = step_length(body, speed);
  const double longest = std::min(usual, kLongestStep * body.leg());
  const auto comfortable = [&] {
    Placement last = walk.from;
    for (int i = 0; i < walk.steps - 1; ++i) {
      const Placement next = walk.footfall(i);
      if ((next.position - last.position).norm() > longest || std::abs(next.yaw - last.yaw) > kMostTurn) return false;
      last = next;
    }
    return true;
  };
  walk.steps = std::max(2, static_cast<int>(std::lround((walk.end - walk.begin) * speed / usual)));
  while (!comfortable()) ++walk.steps;
  walk.end = std::max(walk.end, walk.begin + walk.steps * kHasty);
}

Walk plan_walk(const Body& body, const Placement& from, const Placement& to, double speed, double begin) {
  Walk walk;
  walk.begin = begin;
  walk.from = from;
  walk.to = to;
  const double turn = turn_between(from.yaw, to.yaw);
  walk.to.yaw = from.yaw + turn;
  const Eigen::Vector2d chord = to.position - from.position;
  const double length = chord.norm();
  walk.bulge = -0.5 * std::tan(0.25 * turn) * Eigen::Vector2d(-chord.y(), chord.x());
  walk.end = begin + std::max(kGlidePeak * length / speed, 2.0 * kHasty);
  choose_steps(body, speed, walk);
  walk.first_foot = turn > 0.0 ? 1 : 0;
  return walk;
}

}  // namespace duet::synthesis
