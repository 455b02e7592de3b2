// PAIR's objective, term by term, with its analytic gradient: the double reference that the SIMD kernels are held
// against. Pure.
#pragma once

#include "duet/retarget/options.h"
#include "duet/retarget/pair_problem.h"

namespace duet {

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
