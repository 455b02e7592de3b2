// One PAIR optimisation, ready to be solved: what stays constant (PairProblem) and what is sought (PairVariables).
// The same values feed the double reference, the SIMD kernels and the libtorch peer.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/core/recording.h"
#include "duet/motion/interaction_clip.h"
#include "duet/retarget/ground_plan.h"
#include "duet/retarget/options.h"
#include "duet/retarget/pair_chain.h"
#include "duet/retarget/pair_terms.h"

namespace duet {

inline constexpr double kDistanceGuard = 1e-12;  // [m^2] added to squared distances, so that their root has a slope

struct PairProblem {
  PairChain chain;
  Eigen::VectorXd yaw;            // heading of the source person per frame [rad]: R_WB before optimisation
  Eigen::Matrix3Xd root;          // p_WB before optimisation, (3, T): where it puts the pelvis on the reshaped one [m]
  PointTracks targets;            // (T, 16, 3): Reshaped(H_s)
  PointTracks human;              // (T, K, 3): keypoints of the original partner
  std::vector<int> human_offset;  // per keypoint of the partner: which of the 6 offsets moves it, -1 for none
  Eigen::MatrixXd distances;      // (pairs i < j of the 2 K keypoints, robot's first, row by row; T): D_orig [m]

  Eigen::VectorXd rest;      // (dof): where L_pose pulls and the search begins [rad]
  Eigen::MatrixXd nearness;  // (K K, T), robot's keypoint by row: of a robot-human distance, 0 to 1; empty: 1 for all

  ObjectKeypoints object;        // that the people carry; without points where there is none
  Eigen::MatrixXd bones;         // (18, T): the partner's arm bones before optimisation; empty where w-bone is 0 [m]
  BodySpheres spheres;           // no pairs where w-collision is 0
  PointTracks reshaped;          // (T, 16, 3): Reshaped(H_s) where the robot stands on the ground, empty otherwise
  std::vector<int> robot_joint;  // of each joint of the chain: of the robot, -1 for the base's tilt
  GroundPlan plan;               // where the robot stands on the ground
  bool upright = false;          // the chain is make_upright_chain's: no rotation of the root, no vertical offset

  [[nodiscard]] int frames() const { return static_cast<int>(yaw.size()); }
};

// Rows of PairVariables::frames: q | rotation vector of the root | human offsets, 3 each | translation of the root.
struct PairVariables {
  Eigen::MatrixXd frames;                            // (dof + 24, T)
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // of the root, the same in all frames [m]

  // The search begins at rest, everything else at 0.
  [[nodiscard]] static PairVariables at_rest(const PairProblem& problem) {
    PairVariables x = zero(problem.chain.dof(), problem.frames());
    x.frames.topRows(problem.chain.dof()).colwise() = problem.rest;
    return x;
  }
  [[nodiscard]] static PairVariables zero(int dof, int frames) {
    return {Eigen::MatrixXd::Zero(dof + 6 + 3 * kHumanOffsets, frames), Eigen::Vector3d::Zero()};
  }
};

// `clip` must be valid and at 50 Hz. Throws std::invalid_argument for fewer than 5 frames and for what make_chain,
// reshape and heading refuse; InputError for a broken SMPL file.
PairProblem make_pair_problem(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options);

// PAIR's objective, term by term, with its analytic gradient: the double reference that the SIMD kernels are held
// against. Pure.

// The terms of A.1.1 without their weights.
struct PairTerms {
  double kin = 0.0;
  double con = 0.0;
  double hum = 0.0;
  double temp = 0.0;  // velocity + w_a acceleration
  double pose = 0.0;
  // Terms that the paper does not have.
  double bone = 0.0;       // squared changes of the partner's arm bones, mean over frames
  double partner = 0.0;    // velocity + w_a acceleration of the partner's offsets
  double collision = 0.0;  // squared depths of spheres, mean over frames
  double object = 0.0;     // changes of distance from a carried object, as `con` counts them

  [[nodiscard]] double total(const PairWeights& w) const {
    return w.kin * kin + w.con * con + w.hum * hum + w.temp * temp + w.pose * pose + w.bone * bone +
           w.temp * w.partner * partner + w.collision * collision + w.con * w.object * object;
  }
};

// Factors of the blocks of the distance matrix and of the whole, for the chosen blocks and reduction.
struct ContactFactors {
  double robot = 1.0;  // robot-robot
  double cross = 1.0;
  double human = 1.0;  // human-human
  double all = 1.0;    // 1 (Frobenius) or 1 / N^2
};
ContactFactors contact_factors(const PairOptions& options, int keys);
// The same of the distances from a carried object: its block with the robot counts as robot-human, that with the
// partner as human-human.
ObjectFactors object_factors(const PairOptions& options, int keys);

// The objective at x with `weights` (those of a stage) and, where asked for, its gradient by all variables. Variables
// that the options hold fixed have gradient zero.
PairTerms evaluate(const PairProblem& problem, const PairOptions& options, const PairWeights& weights,
                   const PairVariables& x, PairVariables* gradient = nullptr);

// The root's rotation: exp of the rotation vector (in W) after the heading.
Eigen::Matrix3d root_rotation(double yaw, const Eigen::Vector3d& rotation_vector);

}  // namespace duet
