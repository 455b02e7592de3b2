// One block of frames in vectors: what the terms of the kernels share, and forward kinematics. Included by
// kernel_body.h only.
#pragma once

#include "duet/retarget/kernels/kernel_types.h"

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
  V sphere[kMaxSpheres + kMaxHumanSpheres][3];
  V sphere_pull[kMaxSpheres + kMaxHumanSpheres][3];
  V w[3];     // rotation vector of the root
  V a, b, c;  // its left Jacobian a I + b [w]x + c w w^T
};

// The work of one call of a stage: a block, and the first of the kWidth lanes.
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

}  // namespace
}  // namespace duet::pair_kernel
