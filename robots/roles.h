// Facts that follow from a robot's roles: where the pelvis is, which of its joints tilt the trunk, how it mirrors.
// Functions of a loaded robot alone; thread-safe.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/core/robot_state.h"
#include "duet/core/task.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Axis of the hinge of a joint in the base's frame at q = 0, unit.
Eigen::Vector3d hinge_axis(const RobotModel& robot, int joint);

// Image of a turn's axis in the plane y = 0.
Eigen::Vector3d mirrored_axis(const Eigen::Vector3d& axis);

// 1 where the mirror image of a joint at an angle is its counterpart at the same angle, -1 where at the opposite one.
double mirror_sign(const RobotModel& robot, int joint);

// Whether the joint turns about x rather than y: of an ankle or a hip, its roll.
bool is_roll(const RobotModel& robot, int joint);

// The waist's joints that tilt the trunk: all but those about the vertical.
std::vector<int> tilting_waist(const RobotModel& robot);

// Joints of both legs, ascending.
std::vector<int> leg_joints(const RobotModel& robot);
// Every other joint.
std::vector<int> upper_joints(const RobotModel& robot);

// The soles' shapes by the link that carries them, in the card's order: the left foot's first.
std::vector<std::vector<int>> soles_of_feet(const RobotModel& robot);

// Length of an arm from the shoulder's track along the links to the hand's, 0 left, 1 right: as far as it reaches
// stretched out; in the neutral pose where the shoulder's track lies on the trunk. [m] Throws std::invalid_argument
// where the card lacks one of the two tracks.
double arm_length(const RobotModel& robot, int side);

// The frame that stands for the person's pelvis (the first retarget pair's; the base's origin where there is none), in
// the base. A robot whose base is its trunk has its pelvis below a waist, which turns it. q: dof.
Pose pelvis_in_base(const RobotModel& robot, const Eigen::VectorXd& q);

// Whether the pelvis is the base's own frame, so that pelvis_in_base is the identity to the bit.
bool base_is_pelvis(const RobotModel& robot);

// Primitives that take the place of a motion's preparation and follow-up (supplement A.4.4; section D with Algorithm
// 7). The act is never touched. Legs are those of the robot's card, every other joint is upper body. Motions have the
// robot's joints in its order. Pure functions.

inline constexpr int kSimToRealRamp = 16;      // frames of either ramp of Algorithm 7
inline constexpr double kSimToRealYaw = 0.35;  // "milder yaw" of section D, which prints no figure [rad]

// Preparation: the root from `start` straight to the first act frame, at an even pace.
void walk_straight(RobotMotion& motion, const Phases& phases, const Pose& start);

// Preparation: the root from `start` straight to the first act frame at up to `speed` [m/s], where root and legs wait
// as in that frame; the upper body is neutral, and comes into the act over the act's first 0.4 s. So neither where the
// robot is nor where its arms are tells that the act is about to begin.
void walk_and_wait(RobotMotion& motion, const Phases& phases, const RobotModel& robot, const Pose& start, double speed);

// Preparation: the upper body from neutral to the first act frame over the last `frames`, at most all of it.
void raise_upper_body(RobotMotion& motion, const Phases& phases, const RobotModel& robot, int frames);

// Follow-up: the upper body from the last act frame back to neutral over `frames`.
void lower_upper_body(RobotMotion& motion, const Phases& phases, const RobotModel& robot, double frames);

// Frames [begin, end): root and legs as in frame `source`.
void hold_frame(RobotMotion& motion, const RobotModel& robot, int begin, int end, int source);

// `start` turned about the vertical until its heading is at most `mild_yaw` [rad] from that of `goal`.
Pose mildly_turned(const Pose& start, const Pose& goal, double mild_yaw);

// Algorithm 7. Preparation: the root goes straight from where it starts to the first act frame and turns by at most
// `mild_yaw`; the upper body is neutral and goes to the first act frame over the last 16 frames; legs as they are.
// Follow-up: root and legs as in the last act frame, the upper body goes back to neutral over 16 frames. Throws
// std::invalid_argument where motion, robot and phases do not fit (0 <= act_begin < act_end <= frames) or `mild_yaw` is
// negative.
void sim_to_real(RobotMotion& motion, const Phases& phases, const RobotModel& robot, double mild_yaw = kSimToRealYaw);

// Joint vectors of one robot on another whose joints have the same names: joints that the other lacks are dropped,
// those that only the other has stay at neutral. Immutable.

class JointMap {
 public:
  // Throws std::invalid_argument where the two have joints, but none in common.
  JointMap(const std::vector<std::string>& from, const RobotModel& to);
  [[nodiscard]] Eigen::VectorXd positions(const Eigen::VectorXd& q) const { return fill(q, neutral_); }
  [[nodiscard]] Eigen::VectorXd rates(const Eigen::VectorXd& v) const;  // 0 where there is none
  [[nodiscard]] RobotState state(const RobotState& state) const;

 private:
  [[nodiscard]] Eigen::VectorXd fill(const Eigen::VectorXd& values, Eigen::VectorXd filled) const;

  Eigen::VectorXd neutral_;
  std::vector<int> source_;  // of each joint of `to`; -1 where `from` lacks it
};

// A motion on another robot. Throws as JointMap. With the same joints in the same order: the motion to the bit.
RobotMotion on_body(const RobotMotion& motion, const RobotModel& body);

}  // namespace duet
