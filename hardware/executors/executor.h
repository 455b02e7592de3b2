// The executor of the guard's commands on a robot, and the channels of a 36-D reference that reach it at all. A log
// names both: what was not executed cannot be scored as if it had been. docs/hardware.md, "Executors".
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "duet/hardware/safety/safety_machine.h"
#include "duet/hardware/wire/robot_wire.h"
#include "duet/metrics/contact_limits.h"
#include "duet/robots/robot_model.h"

namespace duet {

enum class ExecutorKind {
  kTwin,             // the guard's own frames to a twin
  kHomieLcm,         // HOMIE's processes, over LCM
  kSport,            // the maker's walking, over DDS: not HOMIE
  kLowcmd,           // the guard's own frames to a robot; a walking controller in the guard keeps it on its feet
  kVendorArmAction,  // the maker's walking and one of its preset arm actions, which nothing here limits
};
inline constexpr std::array<std::string_view, 5> kExecutorNames = {"twin", "homie-lcm", "sport", "lowcmd",
                                                                   "vendor-arm-action"};
std::string_view executor_name(ExecutorKind kind);
// Whether the maker's own walking carries it out.
bool is_makers(ExecutorKind kind);
// Throws std::invalid_argument with the known names.
ExecutorKind executor_kind(const std::string& name);

struct ExecutedChannels {
  ExecutorKind kind = ExecutorKind::kTwin;
  std::string legs;            // who moves them
  std::string_view stop;       // what a damping of the guard does, for the operator
  bool homie = false;          // its walking is HOMIE's
  bool height = false;         // of the pelvis, as told
  std::vector<int> joints;     // as told, by the card
  std::vector<bool> executed;  // of the reference: x, y, z, quaternion w, x, y, z, then the joints of the card. x, y
                               // and the turn are executed as a velocity.
};
// `joints`: those that a limiter lets through (ExecutedJoints). `walker`: the controller in the guard; empty: none.
ExecutedChannels executed_channels(ExecutorKind kind, const RobotModel& robot, const std::vector<int>& joints,
                                   const std::string& walker = "");
nlohmann::json executed_channels_json(const ExecutedChannels& channels, const RobotModel& robot);
// One sentence for the screen: what is executed and what is not.
std::string executed_channels_text(const ExecutedChannels& channels, const RobotModel& robot);

// Why this executor with this odometry cannot be a robot's, or a twin's; empty where it can.
std::string executor_refusal(ExecutorKind kind, OdometrySource odometry, bool twin);
// Why the guard cannot walk with this controller and executor; empty where it can. `told`: it takes velocities.
std::string walker_refusal(ExecutorKind kind, const std::string& walker, bool told);

// The way of the guard's commands to the robot. Every message is made from the guard's limited frame and velocity. One
// owner, one thread.
class Executor : public VelocitySink {
 public:
  // Takes what it has sent us. Called once a tick, from LISTEN on.
  virtual void poll(double now) = 0;
  // When it was last heard of and well; kNever: never. Unused for an executor that does not answer.
  [[nodiscard]] virtual double heard_at() const = 0;
  [[nodiscard]] virtual bool answers() const = 0;
  // The fault of the executor, for the screen; empty where it has none.
  [[nodiscard]] virtual std::string complaint() const = 0;

  // How many others command the robot, beside whom this executor steers. `command_writers`: on the low-level topic.
  virtual int foreign_writers(int command_writers) = 0;
  virtual void open() = 0;
  virtual void close() = 0;
  [[nodiscard]] virtual bool is_open() const = 0;
  virtual bool write(const LowCommandFrame& frame) = 0;
};

// Conditions before a robot is allowed to move: facts that a person made true, one after the other. Pure; the
// readings of clocks are the caller's.

// The permission in the configuration (docs/hardware.md, "Configuration").
struct MotionPermission {
  bool allow_motion = false;
  std::string robot;      // its serial number or address
  std::string interface;  // of the network: named, never chosen by itself
  int domain = -1;        // of DDS: 0 is the robot's own
  int mode_machine = -1;  // that the robot reports
};

struct ArmingFacts {
  MotionPermission permission;
  bool twin = false;  // a twin on this machine, not a robot
  ExecutorKind executor = ExecutorKind::kTwin;
  OdometrySource odometry = OdometrySource::kNone;
  std::string executor_complaint;  // what is wrong with it; empty: nothing
  std::string running_mode;        // of the maker's, that owns the motors; empty: none, or nobody says so
  bool asked_to_arm = false;       // on the command line
  bool dry_run = false;
  ContactLimits contact_limits;
  std::string shown_nonce, typed_nonce;
  double shown_at = kNever;  // [s], as `now`
  double now = 0.0;
  bool remote_key_held = false;
  int reported_mode_machine = -1;
  double free_log_bytes = 0.0;
  bool log_is_open = false;
};

inline constexpr double kNonceTime = 30.0;     // for which what is shown on screen may be typed [s]
inline constexpr double kLeastLogBytes = 1e9;  // on the disk of the log

// Why the robot may not be armed, the first reason as one sentence; empty where it may.
std::string arming_refusal(const ArmingFacts& facts);

}  // namespace duet
