// Forward kinematics and Jacobians of a RobotModel, in double. Buffers are sized on construction: no allocation
// afterwards. Generalised velocity: [v_WB (W), w_WB_B (B), qd], as in RobotState; size 6 + dof.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "duet/core/recording.h"
#include "duet/robots/robot_model.h"

namespace duet {

class Kinematics {
 public:
  explicit Kinematics(const RobotModel& model);  // keeps a reference: the model must outlive it

  // Poses of all links. Sizes are not checked.
  void update(const Pose& X_WB, const Eigen::Ref<const Eigen::VectorXd>& q);

  [[nodiscard]] const RobotModel& model() const { return *model_; }
  [[nodiscard]] const Eigen::Matrix3d& R_WL(int link) const { return R_WL_[link]; }
  [[nodiscard]] const Eigen::Vector3d& p_WL(int link) const { return p_WL_[link]; }
  [[nodiscard]] std::span<const Eigen::Matrix3d> rotations() const { return R_WL_; }  // R_WL of all links
  [[nodiscard]] std::span<const Eigen::Vector3d> positions() const { return p_WL_; }  // p_WL
  [[nodiscard]] Pose X_WL(int link) const { return {Eigen::Quaterniond(R_WL_[link]), p_WL_[link]}; }
  [[nodiscard]] Eigen::Vector3d frame_position(int frame) const;
  [[nodiscard]] Pose frame_pose(int frame) const;
  [[nodiscard]] Eigen::Vector3d shape_position(int shape) const;  // centre of a collision shape
  [[nodiscard]] Eigen::Vector3d center_of_mass() const;

  // Jacobian of the velocity (in W) of the point fixed to `link` that is now at p_W. `J` is 3 x (6 + dof), overwritten.
  void point_jacobian(int link, const Eigen::Vector3d& p_W, Eigen::Ref<Eigen::MatrixXd> J) const;
  // Jacobian of the angular velocity of `link`, in W. 3 x (6 + dof), overwritten.
  void angular_jacobian(int link, Eigen::Ref<Eigen::MatrixXd> J) const;
  void center_of_mass_jacobian(Eigen::Ref<Eigen::MatrixXd> J) const;

 private:
  const RobotModel* model_;
  std::vector<Eigen::Matrix3d> R_WL_;
  std::vector<Eigen::Vector3d> p_WL_;
  struct Hinge {
    Eigen::Matrix3d R_PL0;  // rotation to the parent at q = 0
    bool turned;            // R_PL0 is not the identity
    int principal;          // 0, 1, 2 where the hinge axis is +x, +y, +z of the link; else -1
  };
  std::vector<Hinge> hinges_;  // of links; the base's is unused
};

// Positions over time of chosen frames (indices in RobotModel::frames): (T, frames, 3).
PointTracks frame_tracks(const RobotModel& model, const RobotMotion& motion, const std::vector<int>& frames);

}  // namespace duet
