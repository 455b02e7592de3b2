// What the SIMD kernels read and write: plain arrays of float, so that a kernel file (compiled for a wider instruction
// set) shares no inline code with the rest of the program. One block = one frame of each of 16 time segments of the
// sequence; a row = one quantity of a block, 16 lanes. Frame t of a sequence with S frames per segment lies in block
// t mod S, lane t / S. Every instruction set works on this same layout, so AVX2 and AVX-512 give the same bits.
#pragma once

#include <cstddef>

namespace duet::pair_kernel {

inline constexpr int kLanes = 16;
inline constexpr int kMaxJoints = 48;
inline constexpr int kMaxPoints = 32;
inline constexpr int kMaxKeys = 11;
inline constexpr int kPairs = 16;
inline constexpr int kHumanRows = 18;
inline constexpr int kHalo = 2;  // blocks before the first and after the last, for neighbours in time
inline constexpr int kMaxRows = kMaxJoints + 6 + kHumanRows;

struct alignas(64) Row {
  float lane[kLanes];
};

struct Joint {
  int parent;  // link
  int axis;
  bool turned;
  float offset[3];
  float rotation[9];  // row-major
};

struct Point {
  int link;
  float offset[3];
};

// Constant over the iterations.
struct Setup {
  int dof;
  int points;
  int keys;
  int rows;  // of the variables that move: dof + 3 (rotation), + 18 (human), + 3 (translation per frame)
  bool mean_norm;
  bool adapt_human;
  bool per_frame_translation;
  Joint joints[kMaxJoints];
  float lower[kMaxJoints];
  float upper[kMaxJoints];
  Point point[kMaxPoints];
  int pair_point[kPairs];
  int key_point[kMaxKeys];
  int human_offset[kMaxKeys];
};

// One iteration: factors of the gradient of T times the objective, and Adam's step.
struct Step {
  float kin;
  float con_robot, con_cross, con_human;
  float hum;
  float pose;
  float velocity, acceleration;
  float rate;     // learning rate / (1 - beta1^k)
  float square;   // 1 / sqrt(1 - beta2^k)
  float epsilon;  // T times Adam's, as the gradient is
  float offset[3];
};

// Rows of a block's constants; then the targets (48), the partner's keypoints (3 K), the original distances. Positions
// are relative to the frame's root before optimisation: small numbers, wherever the two stand in the world.
enum Constant {
  kWeight,  // 1 for a frame of the sequence, 0 for padding
  kEdgeBefore,
  kEdgeAfter,  // 1 where the step from t - 1, to t + 1 exists
  kBendBefore,
  kBend,
  kBendAfter,  // 1 where the second difference centred on t - 1, t, t + 1 exists
  kCosYaw,
  kSinYaw,
  kTarget,
  kHuman = kTarget + 3 * kPairs
};

// Sums over frames, per lane: the terms without weights and factors, and the force on the root.
enum Sum : int {
  kKin,
  kConRobot,
  kConCross,
  kConHuman,
  kHum,
  kVelocity,
  kAcceleration,
  kPose,
  kForce,
  kSums = kForce + 3
};

struct Sweep {
  const Setup* setup;
  const Step* step;
  const Row* constants;
  std::size_t constant_rows;
  const Row* x;  // block 0; kHalo blocks lie before it and after the last
  Row* next;
  Row* mean;  // Adam's moments
  Row* square;
  std::size_t rows;  // per block of x, next, mean and square
  int begin, end;    // blocks
  Row* sums;         // kSums rows, added to
};

// One Adam iteration over the blocks. v2 needs nothing beyond x86-64-v2, v3 AVX2 and FMA, v4 AVX-512.
void sweep_v2(const Sweep& sweep);
void sweep_v3(const Sweep& sweep);
void sweep_v4(const Sweep& sweep);

}  // namespace duet::pair_kernel
