// The reference that WBC-Sim tracks, once per tick: the 36-D reference u_t with its legs replaced by steps. Both the
// controller and the training environment use it, so that a policy sees in a rollout what it saw in training. No
// allocation after construction.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <vector>

#include "duet/controllers/stance.h"
#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The clock and the feet of WBC-Sim's reference: when the root's reference moves, or the robot has been pushed away
// from it, the feet step in time; else they stand. It gives the legs what u_t cannot (a retargeted human's leg angles
// are no steps of a robot): where each foot is wanted relative to the root's reference. Value type; no allocation.

struct GaitOptions {
  double frequency = 1.4;        // full cycles [Hz]
  double swing_height = 0.08;    // of the ankle over its height in stance [m]
  double half_width = 0.1185;    // of the stance [m]; WbcTracker takes the card's
  double max_speed = 0.6;        // of the root's reference that feet are placed for [m/s]
  double max_turn = 0.8;         // [rad/s]
  double still_speed = 0.04;     // below this the root is at rest [m/s]
  double still_turn = 0.10;      // [rad/s]
  double start_distance = 0.12;  // of the root from its reference at which feet step though the reference rests [m]
  double start_angle = 0.35;     // likewise of the heading [rad]
  double lead_time = 0.0;        // by which the reference that the network sees is ahead, at its velocity [s]
  double capture_time = 0.0;     // of the robot's velocity that counts as distance: sqrt(height / g), or none [s]
};

// A foot's place relative to the root's reference, in its heading frame on the ground: x forward, y left.
struct FootPlace {
  double x = 0.0, y = 0.0, lift = 0.0;  // [m]
  double yaw = 0.0;                     // [rad]
};

class Gait {
 public:
  explicit Gait(const GaitOptions& options = {}) : options_(options) {}

  void reset();
  // One tick of 0.02 s. `velocity`: of the reference's root in its heading frame, vx, vy [m/s], yaw rate [rad/s];
  // `deviation`: of the robot's root, carried on by its velocity for `capture_time`, from the reference, x, y [m]
  // in that frame and heading [rad].
  void update(const Eigen::Vector3d& velocity, const Eigen::Vector3d& deviation);

  [[nodiscard]] bool stepping() const { return stepping_; }
  // In [0, 1): the left foot swings in [0, 0.5), the right one in [0.5, 1).
  [[nodiscard]] double phase() const { return phase_; }
  [[nodiscard]] int swing_foot() const { return phase_ < 0.5 ? 0 : 1; }                                 // 0: left
  [[nodiscard]] double swing_progress() const { return (phase_ < 0.5 ? phase_ : phase_ - 0.5) * 2.0; }  // [0, 1)
  [[nodiscard]] double half_period() const { return 0.5 / options_.frequency; }                         // [s]
  [[nodiscard]] const Eigen::Vector3d& velocity() const { return velocity_; }  // filtered and bounded
  [[nodiscard]] std::array<FootPlace, 2> feet() const;                         // left, right
  [[nodiscard]] const GaitOptions& options() const { return options_; }

 private:
  void start(const Eigen::Vector3d& deviation);
  [[nodiscard]] FootPlace foot(int side) const;

  GaitOptions options_;
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();
  double phase_ = 0.0;
  double share_ = 0.0;  // of the full lift: grows over the first half cycle
  int resting_ = 0;     // half cycles since the root came to rest
  bool stepping_ = false;
};

// Inverse kinematics of one leg: the joint angles that put its foot where it is wanted, by damped Gauss-Newton from the
// last solution. A fixed number of steps, no allocation: time and result depend on the input alone.
class LegChain {
 public:
  // Throws std::invalid_argument unless the leg has six joints.
  LegChain(const RobotModel& robot, const Leg& leg);

  [[nodiscard]] const std::vector<int>& joints() const { return joints_; }
  // Pose of the foot's link in the base for the leg's joint angles.
  [[nodiscard]] Pose foot_pose(const Eigen::Matrix<double, 6, 1>& q) const;
  // Moves `q`, the start, towards the angles that put the foot at X_BF; within the limits. A pose out of reach gives
  // angles near the nearest one.
  void solve(const Pose& X_BF, Eigen::Matrix<double, 6, 1>& q) const;

 private:
  struct Hinge {
    Eigen::Matrix3d R_PL0;
    Eigen::Vector3d p_PL, axis;
    double lower, upper;
  };
  struct Placed {
    Eigen::Matrix<double, 3, 6> axes, origins;  // in B
    Eigen::Matrix3d R_BF;
    Eigen::Vector3d p_BF;
  };
  [[nodiscard]] Placed place(const Eigen::Matrix<double, 6, 1>& q) const;

  std::vector<int> joints_;
  std::vector<Hinge> hinges_;
};

class WbcTracker {
 public:
  // Bounds of the root's reference and the width of the stance are the card's; what is beyond a bound is tracked at the
  // bound. The width of `gait` is not looked at. Throws std::invalid_argument for a robot that has not two legs of six
  // joints or whose card lacks either.
  explicit WbcTracker(std::shared_ptr<const RobotModel> robot, const GaitOptions& gait = {});

  // Starts at a reference; velocities are zero until the next update.
  void reset(const Reference& reference);
  // One tick of 0.02 s: sizes are not checked.
  void update(const RobotState& state, const Reference& reference);

  [[nodiscard]] const Pose& root() const { return root_; }       // within the bounds, in W
  [[nodiscard]] const Eigen::VectorXd& q() const { return q_; }  // upper body of u_t, legs of the gait [rad]
  [[nodiscard]] const Eigen::VectorXd& v() const { return v_; }  // its rate [rad/s]
  [[nodiscard]] const Eigen::Vector3d& root_velocity() const {
    return root_velocity_;
  }  // vx, vy, yaw rate; heading frame
  // root() as it will be after the gait's lead time.
  [[nodiscard]] Pose led_root() const;
  [[nodiscard]] const Gait& gait() const { return gait_; }
  [[nodiscard]] const RobotModel& robot() const { return *robot_; }
  [[nodiscard]] const std::array<LegChain, 2>& legs() const { return legs_; }  // left, right
  [[nodiscard]] const std::vector<int>& upper() const { return upper_; }       // the other joints
  [[nodiscard]] double ankle_height() const { return ankle_height_; }          // of a standing foot's link [m]
  [[nodiscard]] double foot_x() const { return foot_x_; }                      // of that link ahead of the pelvis [m]

 private:
  void track(const Reference& reference);

  std::shared_ptr<const RobotModel> robot_;
  RootBounds bounds_;
  Gait gait_;
  std::array<LegChain, 2> legs_;
  std::vector<int> upper_;
  double ankle_height_ = 0.0, foot_x_ = 0.0;
  Pose root_, last_root_;
  Eigen::VectorXd q_, v_, last_q_;
  Eigen::Vector3d root_velocity_ = Eigen::Vector3d::Zero();
};

}  // namespace duet
