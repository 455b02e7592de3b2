// The last thing that a command goes through before it leaves for the robot: whatever comes in, what goes out is finite
// and inside the limits, and each change is counted with its reason. The order is that of docs/hardware.md, "Limits".
// tick() depends on its arguments only and does not allocate. One owner, one thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "duet/controllers/root_conversion.h"
#include "duet/core/robot_state.h"
#include "duet/hardware/safety/contact_watch.h"
#include "duet/hardware/safety/limits.h"
#include "duet/metrics/contact_limits.h"

namespace duet {

// Why a command was changed before it went out. Each is counted, each is in the log.

enum class ClampReason {
  kNotFinite,       // the whole command was refused: a number that is not finite
  kSize,            // the whole command was refused: not one target for each joint
  kStamp,           // the whole command was refused: not newer than the one before
  kHold,            // the state machine allows less than full speed
  kNoOdometry,      // nobody measures where the root is
  kFence,           // out of the box
  kSeparation,      // too near a person for this speed
  kPartnerUnknown,  // nobody says where the person is
  kHeadDistance,    // towards head or neck of a person
  kTouchSpeed,      // faster than a touch of this region may be
  kRelease,         // the arms open
  kRootSpeed,
  kRootAcceleration,
  kRootJerk,
  kHeight,
  kJointLimit,
  kJointSpeed,
  kJointAcceleration,
  kJointLead,    // too far ahead of the measured angle
  kJointTorque,  // gains lowered, because the target may not go back fast enough
  kSelfCollision,
};
inline constexpr std::size_t kClampReasons = 21;

using ClampCounts = std::array<long, kClampReasons>;

inline constexpr std::array<std::string_view, kClampReasons> kClampNames = {"not_finite",
                                                                            "size",
                                                                            "stamp",
                                                                            "hold",
                                                                            "no_odometry",
                                                                            "fence",
                                                                            "separation",
                                                                            "partner_unknown",
                                                                            "head_distance",
                                                                            "touch_speed",
                                                                            "release",
                                                                            "root_speed",
                                                                            "root_acceleration",
                                                                            "root_jerk",
                                                                            "height",
                                                                            "joint_limit",
                                                                            "joint_speed",
                                                                            "joint_acceleration",
                                                                            "joint_lead",
                                                                            "joint_torque",
                                                                            "self_collision"};

inline void count(ClampCounts& counts, ClampReason reason) { ++counts[static_cast<std::size_t>(reason)]; }
inline long counted(const ClampCounts& counts, ClampReason reason) { return counts[static_cast<std::size_t>(reason)]; }

// A planner's request: a velocity of the root in its heading frame and a target for every joint of the robot.
struct MotionCommand {
  double stamp = 0.0;  // of the planner, increasing [s]
  VelocityCommand root;
  Eigen::VectorXd q;  // in the card's order [rad]
};

// The joints that an executor moves, by the card's order.
struct ExecutedJoints {
  std::vector<int> joints;   // ascending
  Eigen::VectorXd kp, kd;    // of all joints, those it holds [N m/rad], [N m s/rad]
  bool fixed_gains = false;  // it keeps these whatever is sent: where they would be lowered the target gives way
};

struct LimiterSetup {
  std::shared_ptr<const RobotModel> robot;
  HardwareLimits limits;
  ExecutedJoints executed;
  double dt = 0.002;               // of a tick [s]
  bool person = true;              // somebody may be near: without a known pose nothing moves
  HumanBody human;                 // read where `person`
  ContactLimits contact_limits;    // read where `person`
  std::vector<TouchPair> touches;  // of the task
};

// The inputs of a tick.
struct LimiterInput {
  RobotState state;                     // X_WB in the frame of odometry; joints measured
  bool odometry = false;                // X_WB.p and v_WB are measured
  const HumanJoints* person = nullptr;  // SMPL-24 in the frame of odometry [m]; null: unknown
  double person_speed = 0.0;            // measured [m/s]; HardwareLimits::human_speed is the least that is assumed
  bool acting = false;                  // the task's act lasts: `touches` may touch
  double share = 0.0;                   // of all speeds that the state machine allows, 0 to 1
  bool release = false;                 // open the arms, then step back; with a share of 0 the root stays at rest
};

// The state of the outputs so far.
struct LimiterState {
  AxisState forward, lateral, yaw, height;
  std::vector<AxisState> joints;  // all; only the executed ones move
  MotionCommand good;             // the last that was not refused
  bool has_good = false;
};

// The command that leaves for the robot.
struct LimitedCommand {
  VelocityCommand root;
  Eigen::VectorXd q, kp, kd;  // of all joints; of those that are not executed: measured, 0, 0
};

class Limiter {
 public:
  // Throws std::invalid_argument naming what is wrong: no robot, a person without a body, a dt that is not positive,
  // joints that the robot lacks, gains of another size or below 0, a table of contact limits without a touched region's
  // figures.
  explicit Limiter(const LimiterSetup& setup);

  // At rest where the robot is measured, no command taken yet. Throws std::invalid_argument for a state of another size
  // or not finite.
  [[nodiscard]] LimiterState start(const RobotState& state) const;
  // The same in place, from finite angles of the right number; no allocation. The newest stamp is kept.
  void restart(const Eigen::VectorXd& q, LimiterState& state) const;

  // Why tick() would not take the command: of another size, not finite, not newer than the last good one.
  [[nodiscard]] std::optional<ClampReason> refusal(const MotionCommand& command, const LimiterState& state) const;
  // Takes a newly received command (null: none came), or refuses it as a whole; then one step of the outputs towards
  // the last good one. `state` is finite and of the robot's size.
  void tick(const MotionCommand* received, const LimiterInput& input, LimiterState& state, LimitedCommand& out,
            ClampCounts& counts);

  // Distances of the arms at rest after the last tick, in the last tick's pose of the root.
  [[nodiscard]] const BodyGaps& gaps() const { return distance_.gaps(); }
  // The reasons for which each joint was changed in the last tick: bit k is ClampReason k.
  [[nodiscard]] const std::vector<std::uint32_t>& joint_clamps() const { return joint_clamps_; }
  // The share of all speeds in the last tick, after the distance to a person.
  [[nodiscard]] double share() const { return wanted_.share; }
  [[nodiscard]] const LimiterSetup& setup() const { return setup_; }
  [[nodiscard]] bool executes(int joint) const { return executed_[joint]; }
  [[nodiscard]] const AxisBounds& joint_bounds(int joint) const { return joint_bounds_[joint]; }

 private:
  struct Wanted {
    VelocityCommand root;
    Eigen::VectorXd q;
    // Sets all three.
    void share_all(double value) { share = root_share = arm_share = value; }
    double share = 1.0;                        // of all speeds
    double root_share = 1.0, arm_share = 1.0;  // of it, of those of root and arms
  };

  void admit(const MotionCommand* received, LimiterState& state, ClampCounts& counts) const;
  void choose(const LimiterInput& input, const LimiterState& state, ClampCounts& counts);
  void open_arms(const LimiterInput& input, ClampCounts& counts);
  void keep_distance(const LimiterInput& input, const BodyGaps& gaps, ClampCounts& counts);
  void share_out(double speed);
  void keep_inside(const LimiterInput& input, const BodyGaps& gaps, ClampCounts& counts);
  void move_root(LimiterState& state, ClampCounts& counts) const;
  void move_joints(const LimiterInput& input, LimiterState& state, ClampCounts& counts);
  void avoid_bodies(const LimiterInput& input, const std::vector<AxisState>& before, const BodyGaps& gaps,
                    LimiterState& state, ClampCounts& counts);
  [[nodiscard]] double lead_target(int joint, const LimiterInput& input, ClampCounts& counts);
  [[nodiscard]] double within_torque(int joint, const LimiterInput& input, double target) const;
  void give_way(const LimiterInput& input, LimiterState& state, ClampCounts& counts);
  void write(const LimiterInput& input, const LimiterState& state, LimitedCommand& out, ClampCounts& counts);
  void count_joint_if(bool clamped, int joint, ClampReason reason, ClampCounts& counts);
  const BodyGaps& gaps_at_rest(const LimiterInput& input, const std::vector<AxisState>& joints);
  [[nodiscard]] double allowed_speed(double distance, double person_speed) const;

  LimiterSetup setup_;
  AxisBounds forward_, lateral_, yaw_, height_;
  std::vector<AxisBounds> joint_bounds_;
  std::vector<bool> executed_;        // of each joint
  std::vector<double> touch_speeds_;  // of each capsule of the person [m/s]
  BodyDistance distance_;
  double arm_speed_ = 0.0;       // of a hand by its arm [m/s]
  double creep_speed_ = 0.0;     // that arms keep during an act [m/s]
  double approach_speed_ = 0.0;  // at which a hand and the root may come nearer together [m/s]
  // Values of the tick in work.
  Wanted wanted_;
  std::vector<AxisState> before_;
  Eigen::VectorXd q_rest_;
  std::vector<std::uint32_t> joint_clamps_;
};

}  // namespace duet
