// The terms of the modes on the ground: the partner's arm bones, his offsets in time, spheres of the two bodies.
// Included by kernel_body.h only.
#pragma once

#include "duet/retarget/kernels/kernel_frame.h"

namespace duet::pair_kernel {
namespace {

// All are called after hum_term, whose gradient they add to.
inline void bone_term(const Place& at, Work& k, int row) {
  const int first = at.setup.dof + 3;
  const V weight = at.constant(kWeight);
  const V scale = weight * at.step.bone;
  V sum = V{};
  for (int i = 0; i < kBones; ++i) {
    V before[3], bone[3];
    for (int r = 0; r < 3; ++r) {
      before[r] = at.constant(row + 3 * i + r);
      bone[r] = before[r] + at.variable(first + 3 * i + r);
      if (i >= 2) bone[r] -= at.variable(first + 3 * (i - 2) + r);
    }
    const V length = square_root(dot(bone, bone) + kGuard);
    const V error = length - square_root(dot(before, before));
    sum += error * error;
    const V f = scale * error / length;
    for (int r = 0; r < 3; ++r) {
      k.g[first + 3 * i + r] += f * bone[r];
      if (i >= 2) k.g[first + 3 * (i - 2) + r] -= f * bone[r];
    }
  }
  at.add(kBone, weight * sum);
}

inline void partner_temporal(const Place& at, Work& k) {
  const int first = at.setup.dof + 3;
  const V edge_before = at.constant(kEdgeBefore) * at.step.partner_velocity;
  const V edge_after = at.constant(kEdgeAfter) * at.step.partner_velocity;
  const V bend_before = at.constant(kBendBefore) * at.step.partner_acceleration;
  const V bend = at.constant(kBend) * at.step.partner_acceleration;
  const V bend_after = at.constant(kBendAfter) * at.step.partner_acceleration;
  V velocity = V{};
  V acceleration = V{};
  for (int i = first; i < first + kHumanRows; ++i) {
    const V x0 = at.variable(i);
    const V before = at.variable(i, -1);
    const V after = at.variable(i, 1);
    const V v_before = x0 - before;
    const V v_after = after - x0;
    const V a0 = v_after - v_before;
    const V a_before = v_before - (before - at.variable(i, -2));
    const V a_after = (at.variable(i, 2) - after) - v_after;
    k.g[i] += edge_before * v_before - edge_after * v_after + bend_before * a_before - 2.0f * (bend * a0) +
              bend_after * a_after;
    velocity += at.constant(kEdgeAfter) * (v_after * v_after);
    acceleration += at.constant(kBend) * (a0 * a0);
  }
  at.add(kPartnerVelocity, velocity);
  at.add(kPartnerAcceleration, acceleration);
}

inline void place_spheres(const Place& at, Work& k, int row) {
  const int robots = at.setup.robot_spheres;
  const int first = at.setup.dof + 3;
  for (int i = 0; i < robots + at.setup.human_spheres; ++i) {
    const int human = i - robots;
    const int offset = human >= 0 && at.setup.adapt_human ? at.setup.sphere_offset[human] : -1;
    for (int r = 0; r < 3; ++r) {
      k.sphere[i][r] = human < 0 ? k.point[at.setup.sphere_point[i]][r] : at.constant(row + 3 * human + r);
      if (offset >= 0) k.sphere[i][r] += at.variable(first + 3 * offset + r);
      k.sphere_pull[i][r] = V{};
    }
  }
}

inline void collision_term(const Place& at, Work& k, int row) {
  place_spheres(at, k, row);
  const V weight = at.constant(kWeight);
  const V scale = weight * at.step.collision;
  V sum = V{};
  for (int i = 0; i < at.setup.sphere_pairs; ++i) {
    const SpherePair& pair = at.setup.sphere_pair[i];
    V d[3];
    for (int r = 0; r < 3; ++r) d[r] = k.sphere[pair.a][r] - k.sphere[pair.b][r];
    const V square = dot(d, d) + kGuard;
    const VI touch = square < pair.reach * pair.reach;
    if (!any(touch)) continue;
    const V length = square_root(square);
    const V depth = touch ? pair.reach - length : V{};
    sum += depth * depth;
    const V f = scale * depth / length;
    for (int r = 0; r < 3; ++r) {
      k.sphere_pull[pair.a][r] -= f * d[r];
      k.sphere_pull[pair.b][r] += f * d[r];
    }
  }
  at.add(kCollision, weight * sum);
  const int first = at.setup.dof + 3;
  for (int i = 0; i < at.setup.robot_spheres; ++i) {
    for (int r = 0; r < 3; ++r) k.pull[at.setup.sphere_point[i]][r] += k.sphere_pull[i][r];
  }
  for (int i = 0; i < at.setup.human_spheres && at.setup.adapt_human; ++i) {
    const int offset = at.setup.sphere_offset[i];
    if (offset < 0) continue;
    for (int r = 0; r < 3; ++r) k.g[first + 3 * offset + r] += k.sphere_pull[at.setup.robot_spheres + i][r];
  }
}

inline void ground_terms(const Place& at, Work& k) {
  const int keys = at.setup.keys;
  int row = kHuman + 3 * keys + keys * (2 * keys - 1);
  if (at.setup.bones) {
    if (at.setup.adapt_human) bone_term(at, k, row);
    row += 3 * kBones;
  }
  if (at.setup.adapt_human && at.step.partner_velocity + at.step.partner_acceleration > 0.0f) partner_temporal(at, k);
  if (at.setup.sphere_pairs > 0) collision_term(at, k, row);
}

}  // namespace
}  // namespace duet::pair_kernel
