// The channels of which observations are made, declared once: what each shows, how many numbers it has, and what it is
// called in the three formats that name it. Plain data.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The clock that walking networks are shown, and the gate that tells when a command is one to stand. Nothing allocates
// after construction.

// A command below both is one to stand.
struct StandBounds {
  double speed = 0.0;     // in the plane [m/s]
  double yaw_rate = 0.0;  // [rad/s]
};

// Whether a walker is told to stand, and since when it walks.
class StandGate {
 public:
  explicit StandGate(const std::optional<StandBounds>& bounds = {}) : bounds_(bounds) {}  // none: never to stand

  void reset() {
    walking_tick_ = -1;
    walked_ticks_ = 0;
  }
  // The command of a tick: velocity in the plane [m/s] and yaw rate [rad/s].
  void update(double forward, double lateral, double yaw_rate);

  [[nodiscard]] bool stands() const { return stands_; }              // of the last update
  [[nodiscard]] long walking_tick() const { return walking_tick_; }  // 0 at the first tick of walking
  [[nodiscard]] long walked_ticks() const { return walked_ticks_; }  // of walking, before that of the last update

 private:
  std::optional<StandBounds> bounds_;
  bool stands_ = false;
  long walking_tick_ = -1;
  long walked_ticks_ = 0;
};

// What a clock does that was held while a walker stood.
enum class AfterStanding { kRestarts, kRunsOn, kPauses };

struct GaitClock {
  double frequency_hz = 0.0;
  std::vector<double> phases{};    // at the start [rad]
  std::vector<double> standing{};  // phases held while told to stand, one each; empty: the clock goes on
  std::optional<double> stance{};  // share of a turn, in (0, 1), that takes the first half of the wave
  bool silent = false;             // its waves are both 0 while told to stand: no angle has these
  AfterStanding after_standing = AfterStanding::kRestarts;
};

// Angle of one of the clock's phases [rad]. `tick`: since the start; the gate counts the same ticks, of `period` [s].
// With `standing` the clock goes on as `after_standing` says whenever the gate lets it go.
double gait_angle(const GaitClock& clock, std::size_t phase, long tick, const StandGate& gate, double period = kTick);

// Where channels are named. A channel that a format does not name cannot be shown there.
enum class ChannelFormat {
  kController,  // an IO descriptor (docs/file-formats.md)
  kPolicy,      // a policy descriptor (docs/extending.md, "A policy") and messages to a program
  kNetwork,     // headers of duet's own networks: WBC-Sim, D-STAR (docs/file-formats.md)
};

// The table (io/channel.cpp) and docs/reference/channels.md say what they show.
enum class ChannelKind {
  kPartnerRoot,
  kPartnerJoints,
  kBaseLinearVelocity,
  kBaseAngularVelocity,
  kGravity,
  kRollPitch,
  kRollPitchYaw,
  kCommandVelocity,
  kCommandHeight,
  kCommandStand,
  kJointAngle,
  kJointPosition,  // from the default or the neutral pose
  kJointVelocity,
  kRootOffset,
  kRootOrientation,
  kPreviousAction,
  kReferenceRootVelocity,
  kReferenceHeight,
  kReferenceRollPitch,
  kReferenceYawRate,
  kReferenceJointAngle,
  kReferenceJointPosition,  // from the neutral pose
  kReferenceJointVelocity,
  kReferenceFrames,
  kRootPositionError,
  kRootOrientationError,
  kAnchorPositionError,
  kAnchorOrientationError,
  kGaitSine,
  kGaitCosine,
  kTick,
  kConstant,
  kLanguage,
  kTask,
  kTime,
  kNoise,
};

inline constexpr int kPromptNumbers = 768;  // of a prompt's embedding (supplement A.2.4)

struct Channel {
  ChannelKind kind = ChannelKind::kConstant;
  int line = 0;                                           // in the descriptor's file
  std::vector<double> scale = {1.0};                      // one for all or one each
  std::vector<double> shift = {0.0};                      // of a policy: shown is (value - shift) * scale; likewise
  double clip = std::numeric_limits<double>::infinity();  // bound of the scaled value's size
  std::vector<int> joints = {};                           // of the descriptor's list, in the channel's order
  std::vector<bool> zeroed = {};                          // per entry of `joints`: shown as 0
  std::vector<int> axes = {};                             // components of a vector that are shown
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();       // p_BF of the point whose velocity is shown [m]
  bool clipped = false;                                   // previous_action: after the clip of the actions
  std::string frame = {};                                 // of the robot: the anchor; of a gyro: "" is the base
  int frame_index = -1;                                   // of `frame` in the robot, once it is bound; -1: the base
  GaitClock gait = {};                                    // of a clock
  std::vector<int> steps = {};                            // ticks ahead of the reference's frames, >= 1
  std::vector<double> values = {};                        // of a constant
  int size = 0;                                           // of kTask (the tasks) and kNoise; others know their own
};

// How many numbers a network has where a channel does not say: of joints and of its own output.
struct ChannelWidths {
  int joints = 0;
  int actions = 0;
};

// A channel for a person: of `duet list channels` and the reference page. "" where a format does not name it.
struct ChannelRow {
  ChannelKind kind;
  const char* controller;
  const char* policy;
  const char* network;
  std::string_view keys;  // of an IO descriptor, each between spaces; beside `channel`, `scale` and `clip`
  int size;               // 0: it depends on what is given
  const char* numbers;    // size and unit
  const char* meaning;
};
// In the order of ChannelKind.
const std::vector<ChannelRow>& channel_table();

// "" where the format does not name it.
std::string channel_name(ChannelKind kind, ChannelFormat format);
std::vector<std::string> channel_names(ChannelFormat format);
// Throws std::invalid_argument with the nearest and all known names.
ChannelKind channel_kind(std::string_view name, ChannelFormat format);
// The keys of an IO descriptor that belong to the kind, and whether one does.
std::vector<std::string> channel_keys(ChannelKind kind);
bool takes_key(ChannelKind kind, std::string_view key);
// Numbers that it shows.
int channel_size(const Channel& channel, const ChannelWidths& widths);

// Joints that a file names, found in a robot by their names.

struct JointBinding {
  std::vector<int> indices;          // in the robot, in the file's order; -1: the robot lacks it
  std::vector<std::string> absent;   // named, but not the robot's
  std::vector<std::string> unnamed;  // the robot's, but not named
};

JointBinding bind_by_name(std::span<const std::string> names, const RobotModel& robot);

}  // namespace duet
