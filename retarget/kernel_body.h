// The PAIR iteration in vectors of kWidth floats: forward kinematics, all terms, their gradient by accumulating forces
// and moments from the leaves to the root, Adam, clamping. Included by kernel_v2/v3/v4.cpp only, after they define
// kWidth, V (GCC vector extension), VI and square_root(V). Everything has internal linkage: these files are compiled
// for instruction sets that the linker must not hand to anybody else. float by design:
// twice the lanes, and tests hold its terms to 1e-4 of the scalar reference's.
#pragma once

#include "retarget/kernel_types.h"

namespace duet::pair_kernel {
namespace {

constexpr float kGuard = 1e-12f;      // PairProblem's kDistanceGuard
constexpr float kAngleGuard = 1e-8f;  // keeps the root's rotation vector from a zero norm [rad^2]

inline V load(const Row& row, int lane) {
  V v;
  __builtin_memcpy(&v, row.lane + lane, sizeof v);
  return v;
}
inline void store(Row& row, int lane, V v) { __builtin_memcpy(row.lane + lane, &v, sizeof v); }

// Cody-Waite reduction by pi / 2 and minimax polynomials; good to 2 ulp for |x| < 1e3.
inline void sine_cosine(V x, V& sine, V& cosine) {
  constexpr float kRound = 12582912.0f;  // 1.5 * 2^23: adding it rounds to the nearest integer
  const V turns = (x * 0.63661977236758134f + kRound) - kRound;
  const VI quadrant = __builtin_convertvector(turns, VI);
  const V r = (x - turns * 1.5707963705062866f) + turns * 4.371139000186241e-8f;
  const V r2 = r * r;
  const V s = r + r * r2 * (-1.6666654611e-1f + r2 * (8.3321608736e-3f + r2 * -1.9515295891e-4f));
  const V c = (1.0f - 0.5f * r2) +
              r2 * r2 * (4.166664568298827e-2f + r2 * (-1.388731625493765e-3f + r2 * 2.443315711809948e-5f));
  const VI swap = (quadrant & 1) != 0;
  const V ss = swap ? c : s;
  const V cc = swap ? s : c;
  sine = (quadrant & 2) != 0 ? -ss : ss;
  cosine = ((quadrant + 1) & 2) != 0 ? -cc : cc;
}

inline void cross(const V* a, const V* b, V* out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}
inline V dot(const V* a, const V* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

struct Work {
  V R[kMaxJoints + 1][9];  // R_WL, row-major
  V p[kMaxJoints + 1][3];
  V force[kMaxJoints + 1][3];
  V moment[kMaxJoints + 1][3];
  V point[kMaxPoints][3];
  V pull[kMaxPoints][3];  // d objective / d point
  V key[2 * kMaxKeys][3];
  V key_pull[2 * kMaxKeys][3];
  V g[kMaxRows];
  V w[3];     // rotation vector of the root
  V a, b, c;  // its left Jacobian a I + b [w]x + c w w^T
};

// What one call of a stage works on: a block, and the first of the kWidth lanes.
struct Place {
  const Setup& setup;
  const Step& step;
  const Row* constants;
  const Row* x;
  std::size_t rows;
  Row* sums;
  int lane;

  V constant(int row) const { return load(constants[row], lane); }
  V variable(int row) const { return load(x[row], lane); }
  void add(Sum sum, V v) const { store(sums[sum], lane, load(sums[sum], lane) + v); }
  V variable(int row, long block) const {
    return load(x[static_cast<long>(row) + block * static_cast<long>(rows)], lane);
  }
};

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

inline void turn_root(const Place& at, Work& k) {
  const int dof = at.setup.dof;
  for (int r = 0; r < 3; ++r) {
    k.w[r] = at.variable(dof + r);
    V p = V{} + at.step.offset[r];
    if (at.setup.per_frame_translation) p += at.variable(at.setup.rows - 3 + r);
    k.p[0][r] = p;
  }
  const V* w = k.w;
  const V square = dot(w, w) + kAngleGuard;
  const V angle = square_root(square);
  const V inverse = 1.0f / angle;
  V sh, ch;
  sine_cosine(angle * 0.5f, sh, ch);
  k.a = 2.0f * sh * ch * inverse;
  k.b = 2.0f * sh * sh * inverse * inverse;
  k.c = (1.0f - k.a) * inverse * inverse;
  const V d = 1.0f - k.b * square;
  const V E[9] = {d + k.b * w[0] * w[0],          k.b * w[0] * w[1] - k.a * w[2], k.b * w[0] * w[2] + k.a * w[1],
                  k.b * w[0] * w[1] + k.a * w[2], d + k.b * w[1] * w[1],          k.b * w[1] * w[2] - k.a * w[0],
                  k.b * w[0] * w[2] - k.a * w[1], k.b * w[1] * w[2] + k.a * w[0], d + k.b * w[2] * w[2]};
  const V cy = at.constant(kCosYaw);
  const V sy = at.constant(kSinYaw);
  for (int r = 0; r < 3; ++r) {
    k.R[0][3 * r] = E[3 * r] * cy + E[3 * r + 1] * sy;
    k.R[0][3 * r + 1] = E[3 * r + 1] * cy - E[3 * r] * sy;
    k.R[0][3 * r + 2] = E[3 * r + 2];
  }
}

inline void place_link(const Joint& joint, int link, V angle, Work& k) {
  const V* P = k.R[joint.parent];
  V* L = k.R[link];
  const int A = joint.axis;
  const int B = (A + 1) % 3;
  const int C = (A + 2) % 3;
  V s, c;
  sine_cosine(angle, s, c);
  for (int r = 0; r < 3; ++r) {
    const V* row = P + 3 * r;
    k.p[link][r] =
        k.p[joint.parent][r] + row[0] * joint.offset[0] + row[1] * joint.offset[1] + row[2] * joint.offset[2];
    V m[3] = {row[0], row[1], row[2]};
    if (joint.turned) {
      for (int i = 0; i < 3; ++i) {
        m[i] = row[0] * joint.rotation[i] + row[1] * joint.rotation[3 + i] + row[2] * joint.rotation[6 + i];
      }
    }
    L[3 * r + A] = m[A];
    L[3 * r + B] = c * m[B] + s * m[C];
    L[3 * r + C] = c * m[C] - s * m[B];
  }
}

inline void forward(const Place& at, Work& k) {
  turn_root(at, k);
  for (int j = 0; j < at.setup.dof; ++j) place_link(at.setup.joints[j], j + 1, at.variable(j), k);
  for (int i = 0; i < at.setup.points; ++i) {
    const Point& point = at.setup.point[i];
    const V* R = k.R[point.link];
    for (int r = 0; r < 3; ++r) {
      k.point[i][r] = k.p[point.link][r] + R[3 * r] * point.offset[0] + R[3 * r + 1] * point.offset[1] +
                      R[3 * r + 2] * point.offset[2];
      k.pull[i][r] = V{};
    }
  }
}

inline void kin_term(const Place& at, Work& k) {
  const V weight = at.constant(kWeight);
  V sum = V{};
  for (int i = 0; i < kPairs; ++i) {
    const int point = at.setup.pair_point[i];
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

// Keypoint i against keypoints begin <= j < end, whose original distances lie in the rows from `distance` on.
inline V con_rows(const Place& at, Work& k, int i, int begin, int end, int distance, V scale) {
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
    sum += error * error;
    const V f = error * scale / length;
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
    if (at.step.con_robot != 0.0f) robot_sum += con_rows(at, k, i, i + 1, keys, row, robot);
    row += keys - 1 - i;
    cross_sum += con_rows(at, k, i, keys, 2 * keys, row, cross);
    row += keys;
  }
  if (at.setup.adapt_human && at.step.con_human != 0.0f) {
    for (int i = keys; i < 2 * keys; ++i) {
      human_sum += con_rows(at, k, i, i + 1, 2 * keys, row, human);
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

inline void pose_term(const Place& at, Work& k) {
  const V weight = at.constant(kWeight);
  const V scale = weight * at.step.pose;
  V sum = V{};
  for (int j = 0; j < at.setup.dof; ++j) {
    const V x = at.variable(j);
    sum += x * x;
    k.g[j] += scale * x;
  }
  at.add(kPose, weight * sum);
}

// From the pulls on points to the gradient by joints, root rotation and root position.
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

inline void sweep_blocks(const Sweep& sweep) {
  Work k;
  for (int block = sweep.begin; block < sweep.end; ++block) {
    const std::size_t first = static_cast<std::size_t>(block) * sweep.rows;
    const Row* constants = sweep.constants + static_cast<std::size_t>(block) * sweep.constant_rows;
    for (int lane = 0; lane < kLanes; lane += kWidth) {
      const Place at{*sweep.setup, *sweep.step, constants, sweep.x + first, sweep.rows, sweep.sums, lane};
      temporal(at, k);
      forward(at, k);
      kin_term(at, k);
      con_term(at, k);
      hum_term(at, k);
      pose_term(at, k);
      pull_back(at, k);
      adam(at, k, sweep.mean + first, sweep.square + first, sweep.next + first);
    }
  }
}

}  // namespace
}  // namespace duet::pair_kernel
