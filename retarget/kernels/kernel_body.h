// The PAIR iteration in vectors of kWidth floats: forward kinematics, all terms, their gradient by accumulating forces
// and moments from the leaves to the root, Adam, clamping. Included by kernel_v2/v3/v4.cpp only, after they define
// kWidth, V (GCC vector extension), VI and square_root(V). Everything has internal linkage: these files are compiled
// for instruction sets that the linker must not hand to anybody else. float by design:
// twice the lanes, and tests hold its terms to 1e-4 of the scalar reference's.
#pragma once

#include "duet/retarget/kernels/kernel_frame.h"
#include "duet/retarget/kernels/kernel_ground.h"
#include "duet/retarget/kernels/kernel_object.h"

namespace duet::pair_kernel {
namespace {

inline void temporal(const Place& at, Work& k) {
  const V edge_before = at.constant(kEdgeBefore) * at.step.velocity;
  const V edge_after = at.constant(kEdgeAfter) * at.step.velocity;
  const V bend_before = at.constant(kBendBefore) * at.step.acceleration;
  const V bend = at.constant(kBend) * at.step.acceleration;
  const V bend_after = at.constant(kBendAfter) * at.step.acceleration;
  const V has_edge = at.constant(kEdgeAfter);
  const V has_bend = at.constant(kBend);
  V velocity = V{};
  V acceleration = V{};
  for (int j = 0; j < at.setup.dof; ++j) {
    const V x0 = at.variable(j);
    const V before = at.variable(j, -1);
    const V after = at.variable(j, 1);
    const V v_before = x0 - before;
    const V v_after = after - x0;
    const V a0 = v_after - v_before;
    const V a_before = v_before - (before - at.variable(j, -2));
    const V a_after = (at.variable(j, 2) - after) - v_after;
    const V pull = edge_before * v_before - edge_after * v_after;
    k.g[j] = pull + bend_before * a_before - 2.0f * (bend * a0) + bend_after * a_after;
    velocity += has_edge * (v_after * v_after);
    acceleration += has_bend * (a0 * a0);
  }
  at.add(kVelocity, velocity);
  at.add(kAcceleration, acceleration);
}

template <bool kExtended>
inline void kin_term(const Place& at, Work& k) {
  const V weight = at.constant(kWeight);
  V sum = V{};
  for (int i = 0; i < kPairs; ++i) {
    const int point = at.setup.pair_point[i];
    if (kExtended && point < 0) continue;
    V d[3];
    for (int r = 0; r < 3; ++r) d[r] = k.point[point][r] - at.constant(kTarget + 3 * i + r);
    const V square = dot(d, d);
    V scale = weight * at.step.kin;
    if (at.setup.mean_norm) {
      const V norm = square_root(square + kGuard);
      sum += norm;
      scale = scale / norm;
    } else {
      sum += square;
    }
    for (int r = 0; r < 3; ++r) k.pull[point][r] += scale * d[r];
  }
  at.add(kKin, weight * sum);
}

inline void place_keys(const Place& at, Work& k) {
  const int keys = at.setup.keys;
  const int first = at.setup.dof + 3;
  for (int i = 0; i < keys; ++i) {
    const int offset = at.setup.human_offset[i];
    for (int r = 0; r < 3; ++r) {
      k.key[i][r] = k.point[at.setup.key_point[i]][r];
      V human = at.constant(kHuman + 3 * i + r);
      if (offset >= 0 && at.setup.adapt_human) human += at.variable(first + 3 * offset + r);
      k.key[keys + i][r] = human;
      k.key_pull[i][r] = V{};
      k.key_pull[keys + i][r] = V{};
    }
  }
}

// Weights of distances: none, those of the two keypoints, or a row of the constants for each distance.
enum class Weighing { kNone, kKeys, kRows };

// Keypoint i against keypoints begin <= j < end, whose original distances lie in the rows from `distance` on, and their
// weights, where each has its own, in the rows from `near` on.
template <Weighing kWeighing>
inline V con_rows(const Place& at, Work& k, int i, int begin, int end, int distance, V scale, int near = 0) {
  const V x0 = k.key[i][0];
  const V x1 = k.key[i][1];
  const V x2 = k.key[i][2];
  V g0 = V{};
  V g1 = V{};
  V g2 = V{};
  V sum = V{};
  for (int j = begin; j < end; ++j) {
    const V d0 = x0 - k.key[j][0];
    const V d1 = x1 - k.key[j][1];
    const V d2 = x2 - k.key[j][2];
    const V length = square_root(d0 * d0 + d1 * d1 + d2 * d2 + kGuard);
    const V error = length - at.constant(distance + j - begin);
    V f;
    if constexpr (kWeighing == Weighing::kRows) {
      const V own = at.constant(near + j - begin);
      if (!any(own > V{})) continue;
      sum += own * (error * error);
      f = error * (own * scale) / length;
    } else if constexpr (kWeighing == Weighing::kKeys) {
      const float own = at.setup.key_weight[i % at.setup.keys] * at.setup.key_weight[j % at.setup.keys];
      sum += own * (error * error);
      f = error * (own * scale) / length;
    } else {
      sum += error * error;
      f = error * scale / length;
    }
    g0 += f * d0;
    g1 += f * d1;
    g2 += f * d2;
    k.key_pull[j][0] -= f * d0;
    k.key_pull[j][1] -= f * d1;
    k.key_pull[j][2] -= f * d2;
  }
  k.key_pull[i][0] += g0;
  k.key_pull[i][1] += g1;
  k.key_pull[i][2] += g2;
  return sum;
}

template <Weighing kOwn, Weighing kCross>
inline void con_term(const Place& at, Work& k) {
  place_keys(at, k);
  const int keys = at.setup.keys;
  const V weight = at.constant(kWeight);
  const V robot = weight * at.step.con_robot;
  const V cross = weight * at.step.con_cross;
  const V human = weight * at.step.con_human;
  int row = kHuman + 3 * keys;
  V robot_sum = V{};
  V cross_sum = V{};
  V human_sum = V{};
  for (int i = 0; i < keys; ++i) {
    if (at.step.con_robot != 0.0f) robot_sum += con_rows<kOwn>(at, k, i, i + 1, keys, row, robot);
    row += keys - 1 - i;
    cross_sum += con_rows<kCross>(at, k, i, keys, 2 * keys, row, cross, at.setup.near_row + i * keys);
    row += keys;
  }
  if (at.setup.adapt_human && at.step.con_human != 0.0f) {
    for (int i = keys; i < 2 * keys; ++i) {
      human_sum += con_rows<kOwn>(at, k, i, i + 1, 2 * keys, row, human);
      row += 2 * keys - 1 - i;
    }
  }
  at.add(kConRobot, weight * robot_sum);
  at.add(kConCross, weight * cross_sum);
  at.add(kConHuman, weight * human_sum);
  for (int i = 0; i < keys; ++i) {
    for (int r = 0; r < 3; ++r) k.pull[at.setup.key_point[i]][r] += k.key_pull[i][r];
  }
}

inline void hum_term(const Place& at, Work& k) {
  if (!at.setup.adapt_human) return;
  const int first = at.setup.dof + 3;
  const V weight = at.constant(kWeight);
  V sum = V{};
  for (int i = 0; i < kHumanRows; ++i) {
    const V x = at.variable(first + i);
    sum += x * x;
    k.g[first + i] = weight * at.step.hum * x;
  }
  at.add(kHum, weight * sum);
  for (int i = 0; i < at.setup.keys; ++i) {
    const int offset = at.setup.human_offset[i];
    if (offset < 0) continue;
    for (int r = 0; r < 3; ++r) k.g[first + 3 * offset + r] += k.key_pull[at.setup.keys + i][r];
  }
}

template <bool kExtended>
inline void pose_term(const Place& at, Work& k) {
  const V weight = at.constant(kWeight);
  const V scale = weight * at.step.pose;
  V sum = V{};
  for (int j = 0; j < at.setup.dof; ++j) {
    V x = at.variable(j);
    if (kExtended) x -= at.setup.rest[j];
    sum += x * x;
    k.g[j] += scale * x;
  }
  at.add(kPose, weight * sum);
}

// From the pulls on points to the gradient by joints, root rotation and root position.
template <bool kExtended>
inline void pull_back(const Place& at, Work& k) {
  const int dof = at.setup.dof;
  for (int i = 0; i <= dof; ++i) {
    for (int r = 0; r < 3; ++r) k.force[i][r] = k.moment[i][r] = V{};
  }
  for (int i = 0; i < at.setup.points; ++i) {
    const int link = at.setup.point[i].link;
    V m[3];
    cross(k.point[i], k.pull[i], m);
    for (int r = 0; r < 3; ++r) {
      k.force[link][r] += k.pull[i][r];
      k.moment[link][r] += m[r];
    }
  }
  V m[3];
  for (int j = dof - 1; j >= 0; --j) {
    const Joint& joint = at.setup.joints[j];
    const V* R = k.R[j + 1] + joint.axis;
    cross(k.p[j + 1], k.force[j + 1], m);
    k.g[j] +=
        R[0] * (k.moment[j + 1][0] - m[0]) + R[3] * (k.moment[j + 1][1] - m[1]) + R[6] * (k.moment[j + 1][2] - m[2]);
    for (int r = 0; r < 3; ++r) {
      k.force[joint.parent][r] += k.force[j + 1][r];
      k.moment[joint.parent][r] += k.moment[j + 1][r];
    }
  }
  cross(k.p[0], k.force[0], m);
  V torque[3];
  for (int r = 0; r < 3; ++r) torque[r] = k.moment[0][r] - m[r];
  V wt[3];
  cross(k.w, torque, wt);
  const V along = k.c * dot(k.w, torque);
  for (int r = 0; r < 3; ++r) {
    k.g[dof + r] = k.a * torque[r] - k.b * wt[r] + along * k.w[r];
    if (kExtended && at.setup.upright) k.g[dof + r] = V{};
    if (at.setup.per_frame_translation) k.g[at.setup.rows - 3 + r] = k.force[0][r];
    at.add(static_cast<Sum>(kForce + r), k.force[0][r]);
  }
}

inline void adam(const Place& at, const Work& k, Row* mean, Row* square, Row* next) {
  const float rate = at.step.rate;
  const float bias = at.step.square;
  const float epsilon = at.step.epsilon;
  for (int i = 0; i < at.setup.rows; ++i) {
    const V g = k.g[i];
    const V m = load(mean[i], at.lane) * 0.9f + g * 0.1f;
    const V v = load(square[i], at.lane) * 0.999f + g * g * 0.001f;
    store(mean[i], at.lane, m);
    store(square[i], at.lane, v);
    V x = at.variable(i) - rate * m / (square_root(v) * bias + epsilon);
    if (i < at.setup.dof) {
      x = x < at.setup.lower[i] ? V{} + at.setup.lower[i] : x;
      x = x > at.setup.upper[i] ? V{} + at.setup.upper[i] : x;
    }
    store(next[i], at.lane, x);
  }
}

template <bool kExtended>
inline void sweep_with(const Sweep& sweep) {
  Work k;
  for (int block = sweep.begin; block < sweep.end; ++block) {
    const std::size_t first = static_cast<std::size_t>(block) * sweep.rows;
    const Row* constants = sweep.constants + static_cast<std::size_t>(block) * sweep.constant_rows;
    for (int lane = 0; lane < kLanes; lane += kWidth) {
      const Place at{*sweep.setup, *sweep.step, constants, sweep.x + first, sweep.rows, sweep.sums, lane};
      temporal(at, k);
      forward(at, k);
      kin_term<kExtended>(at, k);
      if (kExtended && at.setup.near_row > 0) {
        con_term<Weighing::kKeys, Weighing::kRows>(at, k);
      } else if (kExtended && at.setup.weighted) {
        con_term<Weighing::kKeys, Weighing::kKeys>(at, k);
      } else {
        con_term<Weighing::kNone, Weighing::kNone>(at, k);
      }
      if (kExtended && at.setup.objects > 0) object_term(at, k);
      hum_term(at, k);
      if (kExtended) ground_terms(at, k);
      pose_term<kExtended>(at, k);
      pull_back<kExtended>(at, k);
      if (sweep.gradient != nullptr) {
        for (std::size_t i = 0; i < sweep.rows; ++i) store(sweep.gradient[first + i], lane, k.g[i]);
      } else {
        adam(at, k, sweep.mean + first, sweep.square + first, sweep.next + first);
      }
    }
  }
}

inline void sweep_blocks(const Sweep& sweep) {
  if (sweep.setup->extended) {
    sweep_with<true>(sweep);
  } else {
    sweep_with<false>(sweep);
  }
}

}  // namespace
}  // namespace duet::pair_kernel
