#include "duet/tasks/synthesis/solid.h"

#include <algorithm>
#include <array>

namespace duet::synthesis {
namespace {

struct Column {
  int from, to;
  double begin, end;  // of the axis, in shares of the way from joint to joint
  double radius;      // at the reference spine [m]
};

constexpr double kReferenceSpine = 0.51, kReferenceHand = 0.085;  // [m]
constexpr double kHandRadius = 0.030, kHandBegin = 0.3, kHandEnd = 1.6;
constexpr std::array<Column, 12> kColumns = {{{kNeck, kHead, 0.9, 1.7, 0.095},
                                              {kNeck, kHead, 0.0, 0.8, 0.060},
                                              {kSpine3, kNeck, 0.0, 0.5, 0.115},
                                              {kSpine2, kSpine3, 0.0, 1.0, 0.120},
                                              {kSpine1, kSpine2, 0.0, 1.0, 0.120},
                                              {kPelvis, kSpine1, 0.0, 1.0, 0.120},
                                              {kPelvis, kLeftHip, 0.0, 1.0, 0.100},
                                              {kPelvis, kRightHip, 0.0, 1.0, 0.100},
                                              {kSpine3, kLeftCollar, 0.0, 1.0, 0.090},
                                              {kSpine3, kRightCollar, 0.0, 1.0, 0.090},
                                              {kLeftCollar, kLeftShoulder, 0.0, 1.0, 0.065},
                                              {kRightCollar, kRightShoulder, 0.0, 1.0, 0.065}}};

double spine_of(const Body& body) {
  double length = 0.0;
  for (const int joint : {kSpine1, kSpine2, kSpine3, kNeck}) length += body.offset[joint].norm();
  return length;
}

// The nearest points of two segments, by alternating projection: both are short and few steps are enough for contact.
std::array<Eigen::Vector3d, 2> nearest_points(const SolidPart& one, const SolidPart& other) {
  const auto project = [](const Eigen::Vector3d& point, const SolidPart& part) {
    const Eigen::Vector3d way = part.to - part.from;
    const double share = std::clamp((point - part.from).dot(way) / std::max(way.squaredNorm(), 1e-12), 0.0, 1.0);
    return Eigen::Vector3d(part.from + share * way);
  };
  Eigen::Vector3d p = 0.5 * (one.from + one.to), q = project(p, other);
  for (int i = 0; i < 12; ++i) {
    p = project(q, one);
    q = project(p, other);
  }
  return {p, q};
}

}  // namespace

std::vector<SolidPart> solid_parts(const Body& body, const Figure& figure) {
  const double size = spine_of(body) / kReferenceSpine;
  std::vector<SolidPart> parts;
  parts.reserve(kColumns.size());
  for (const Column& column : kColumns) {
    const Eigen::Vector3d from = figure.p.col(column.from), bone = figure.p.col(column.to) - from;
    parts.push_back({from + column.begin * bone, from + column.end * bone, size * column.radius});
  }
  return parts;
}

SolidPart solid_hand(const Body& body, const Figure& figure, int side) {
  const Eigen::Vector3d wrist = figure.p.col(sided(kLeftWrist, side));
  const Eigen::Vector3d bone = figure.p.col(sided(kLeftHand, side)) - wrist;
  return {wrist + kHandBegin * bone, wrist + kHandEnd * bone, kHandRadius * body.hand / kReferenceHand};
}

Overlap overlap_of(const SolidPart& part, const SolidPart& other) {
  const auto [p, q] = nearest_points(part, other);
  const double distance = (p - q).norm();
  Overlap overlap{.depth = part.radius + other.radius - distance};
  if (distance > 1e-9) overlap.out = (p - q) / distance;
  return overlap;
}

void pose_arm_outside(const Body& body, const ArmPose& arm, int side, const std::vector<SolidPart>& partner,
                      Figure& figure) {
  constexpr int kMost = 24;
  ArmPose pose = arm;
  pose_arm(body, pose, side, figure);
  for (int i = 0; i < kMost; ++i) {
    const SolidPart hand = solid_hand(body, figure, side);
    Overlap worst;
    for (const SolidPart& part : partner) {
      const Overlap overlap = overlap_of(hand, part);
      if (overlap.depth > worst.depth) worst = overlap;
    }
    if (worst.depth < 1e-4) return;
    // From where the hand is, not from a target that it cannot reach.
    pose.hand = figure.p.col(sided(kLeftHand, side)) + 1.05 * worst.depth * worst.out;
    pose_arm(body, pose, side, figure);
  }
}

}  // namespace duet::synthesis
