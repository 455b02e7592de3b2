// Data that the SIMD kernels read and write: plain arrays of float, so that a kernel file (compiled for a wider
// instruction set) shares no inline code with the rest of the program. A block is one frame of each of 16 time segments
// of the sequence, a row one quantity of a block, 16 lanes. Frame t of a sequence with S frames per segment lies in
// block t mod S, lane t / S. Every instruction set works on this same layout, so AVX2 and AVX-512 give the same bits.
#pragma once

#include <cstddef>

namespace duet::pair_kernel {

inline constexpr int kLanes = 16;
inline constexpr int kMaxJoints = 48;
inline constexpr int kMaxPoints = 48;
inline constexpr int kMaxKeys = 11;
inline constexpr int kPairs = 16;
inline constexpr int kHumanRows = 18;
inline constexpr int kBones = 6;  // of the partner's arms; bone k ends at his offset k
inline constexpr int kMaxHumanSpheres = 16;
inline constexpr int kMaxSpheres = 32;  // of both bodies
inline constexpr int kMaxSpherePairs = 384;
inline constexpr int kMemory = 3;  // steps that L-BFGS remembers: more save fewer evaluations than they cost
inline constexpr int kHalo = 2;    // blocks before the first and after the last, for neighbours in time
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

// Two spheres by index, the robot's before the partner's, and the sum of their radii [m].
struct SpherePair {
  int a, b;
  float reach;
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
  int pair_point[kPairs];  // -1: the chain has no such point
  int key_point[kMaxKeys];
  int human_offset[kMaxKeys];
  // Members for the modes on the ground; the paper's kernel leaves them alone.
  bool extended;
  bool upright;  // the root does not turn
  bool bones;
  int robot_spheres, human_spheres, sphere_pairs;
  int sphere_point[kMaxSpheres];  // of the robot's
  int sphere_offset[kMaxHumanSpheres];
  SpherePair sphere_pair[kMaxSpherePairs];
  bool weighted;  // a keypoint's weight is not 1
  float key_weight[kMaxKeys];
  int objects;     // keypoints of a carried object
  int object_row;  // of the constants: the object's keypoints (3 each), then distances of each of 2 K keypoints
  float key_object[kMaxKeys];
  float rest[kMaxJoints];
  int near_row;  // of the constants: weights of the robot-human distances, with those of the keypoints; 0: none
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
  float bone;
  float partner_velocity, partner_acceleration;
  float collision;
  float object_robot, object_human;
};

// Rows of a block's constants; then the targets (48), the partner's keypoints (3 K), the original distances, and for
// the extended kernel the partner's arm bones (18), his spheres (3 each) and a carried object. Positions
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
  kBone,
  kPartnerVelocity,
  kPartnerAcceleration,
  kCollision,
  kObjectRobot,
  kObjectHuman,
  kForce,
  kSums = kForce + 3
};

struct Sweep {
  const Setup* setup = nullptr;
  const Step* step = nullptr;
  const Row* constants = nullptr;
  std::size_t constant_rows = 0;
  const Row* x = nullptr;  // block 0; kHalo blocks lie before it and after the last
  Row* next = nullptr;
  Row* mean = nullptr;  // Adam's moments
  Row* square = nullptr;
  std::size_t rows = 0;     // per block of x, next, mean and square
  int begin = 0, end = 0;   // blocks
  Row* sums = nullptr;      // kSums rows, added to
  Row* gradient = nullptr;  // where not null, the gradient goes there and nothing moves
};

// Vectors of L-BFGS: blocks of `rows` rows each, as x is. The space that it works in is that of the preconditioner
// P = L D L^T, with L of three bands and constant along time: z = D^(1/2) L^T x. Per row of the variables:
struct Filter {
  float first[kMaxRows], second[kMaxRows];  // l1, l2 of L
  float scale[kMaxRows];                    // D^(1/2)
  float inverse[kMaxRows];                  // D^(-1/2)
};

struct VectorSweep {
  const Setup* setup;
  const Filter* filter;
  std::size_t rows;
  int blocks;
  int begin, end;  // blocks, of dots_* only
};

// The functions of one instruction set; the table of each stands in the kernel file that is compiled for it.
struct LaneKernel {
  // One Adam iteration over the blocks.
  void (*sweep)(const Sweep& sweep);
  // gradient -> D^(-1/2) L^-1 of it, with the gradient of variables at their bounds that want to go out set to zero;
  // each lane's segment from a state of zero.
  void (*filter_gradient)(const VectorSweep&, const Row* x, const Row* gradient, Row* out);
  // s = D^(1/2) L^T (x1 - x0), y = g1 - g0. x0, x1 have their halo.
  void (*step)(const VectorSweep&, const Row* x0, const Row* x1, const Row* g0, const Row* g1, Row* s, Row* y);
  // Products of the `newest` s and y and of g with all `count` vectors and g, lane by lane: sums[3 i], [3 i + 1],
  // [3 i + 2] are those of vector i with vectors[newest], vectors[newest + 1], g; i = count is g itself.
  void (*dots)(const VectorSweep&, const Row* const* vectors, int count, int newest, const Row* g, Row* sums);
  // out = L^-T D^(-1/2) sum_i factors[i] vectors[i], each lane's segment from a state of zero at its end.
  void (*combine)(const VectorSweep&, const Row* const* vectors, const float* factors, int count, Row* out);
  // next = x + rate * direction, no joint by more than `turn`, inside the bounds.
  void (*move)(const VectorSweep&, const Row* x, const Row* direction, float rate, float turn, Row* next);
};

extern const LaneKernel kPortable;      // plain C++, four lanes at a time: any processor
extern const LaneKernel kV2, kV3, kV4;  // x86-64-v2, AVX2 with FMA, AVX-512: on x86-64 only

}  // namespace duet::pair_kernel
