// Rigid-body dynamics of a RobotModel: recursive Newton-Euler and the joint-space mass matrix, in the generalised
// velocity of robots/kinematics.h. Source: Featherstone, Rigid Body Dynamics Algorithms, chapters 5, 6 and 9.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "duet/robots/kinematics.h"
#include "duet/robots/robot_model.h"

namespace duet {

inline constexpr double kGravity = 9.81;  // [m/s^2], along -z of W

// The three functions below, and mass and bias in one pass, without allocation after construction: for loops. Not
// thread-safe; keeps a reference to the model, which must outlive it.
class Dynamics {
 public:
  explicit Dynamics(const RobotModel& model, const Eigen::Vector3d& gravity_W = {0.0, 0.0, -kGravity});

  // Poses, velocities, mass matrix and bias forces of `state` in one pass; the accessors below are then of it.
  void update(const RobotState& state);
  [[nodiscard]] const Eigen::MatrixXd& mass() const { return mass_; }  // without armature
  [[nodiscard]] const Eigen::VectorXd& bias() const { return bias_; }  // as bias_forces()

  void bias_forces(const RobotState& state, Eigen::Ref<Eigen::VectorXd> out);
  void inverse_dynamics(const RobotState& state, const Eigen::Ref<const Eigen::VectorXd>& a,
                        Eigen::Ref<Eigen::VectorXd> out);
  void mass_matrix(const RobotState& state, Eigen::Ref<Eigen::MatrixXd> out);

  // Poses of the last call's state.
  [[nodiscard]] const Kinematics& kinematics() const { return kinematics_; }

 private:
  // Newton-Euler without armature.
  void newton_euler(const RobotState& state, const Eigen::Ref<const Eigen::VectorXd>& a,
                    Eigen::Ref<Eigen::VectorXd> out);
  void accumulate_composites();
  void project_composites(Eigen::Ref<Eigen::MatrixXd> out) const;

  struct Body {  // all in W
    Eigen::Vector3d axis = Eigen::Vector3d::Zero();
    Eigen::Vector3d w = Eigen::Vector3d::Zero(), dw = Eigen::Vector3d::Zero();  // angular velocity, acceleration
    Eigen::Vector3d a = Eigen::Vector3d::Zero();                                // of the origin, less gravity
    Eigen::Vector3d f = Eigen::Vector3d::Zero(), n = Eigen::Vector3d::Zero();   // on the body at its origin
    double mass = 0.0;                                                          // of the body and all it carries
    Eigen::Vector3d com = Eigen::Vector3d::Zero();
    Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about `com`
  };

  const RobotModel* model_;
  Eigen::Vector3d gravity_;
  Kinematics kinematics_;
  std::vector<Body> bodies_;
  Eigen::VectorXd zero_, bias_;
  Eigen::MatrixXd mass_;
};

// Generalised forces that give zero generalised acceleration: Coriolis, centrifugal and gravity terms, (6 + dof).
// [N] for the base's translation (W), [N m] for its rotation (B) and the joints. Armature does not enter.
void bias_forces(const RobotModel& model, const RobotState& state, Eigen::Ref<Eigen::VectorXd> out);

// Inverse dynamics: generalised forces for the acceleration `a` (same layout), bias and armature included: M a + bias.
void inverse_dynamics(const RobotModel& model, const RobotState& state, const Eigen::VectorXd& a,
                      Eigen::Ref<Eigen::VectorXd> out);

// (6 + dof) x (6 + dof), symmetric; armature on the diagonal of the joints.
void mass_matrix(const RobotModel& model, const RobotState& state, Eigen::Ref<Eigen::MatrixXd> out);

// Factor of a symmetric positive definite matrix with the sparsity of a kinematic tree, H = L^T L: no fill-in, so a
// humanoid's costs about a third of a dense one. Source: Featherstone, Rigid Body Dynamics Algorithms, section 6.5. No
// allocation after construction.
class TreeFactor {
 public:
  using Triple = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

  // Prepares a factor over the generalised velocity of robots/kinematics.h: 6 + dof rows.
  explicit TreeFactor(const RobotModel& model);

  // Factors mass + diag(0, joint_inertia). False where it is not positive definite.
  bool compute(const Eigen::MatrixXd& mass, const Eigen::VectorXd& joint_inertia);
  // x <- H^-1 x
  void solve(Eigen::VectorXd& x) const;
  // The same for three columns that are zero outside `rows`, which fall and hold the ancestors of all they hold.
  void solve(std::span<const int> rows, Triple& x) const;
  // x <- L^-T x: the products of two such columns are those of the columns with H^-1 between them.
  void half_solve(std::span<const int> rows, Triple& x) const;

 private:
  std::vector<int> parent_;                  // of each row: the next row that its joint's motion reaches; -1: none
  std::vector<std::vector<int>> ancestors_;  // of each row, nearest first
  Eigen::MatrixXd L_;                        // lower triangle, where the tree has entries
  Eigen::VectorXd inverse_;                  // of its diagonal
};

}  // namespace duet
