// An IO descriptor: what a controller's network is shown and what its output means, as data. A tracker is added by
// writing one (docs/extending.md). Format: docs/file-formats.md, "IO descriptor". Joints are named, not yet
// bound to a robot.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/io/observation.h"

namespace duet {

// Numbers between which an action is taken, before its scale.
struct ActionRange {
  double lower = -std::numeric_limits<double>::infinity(), upper = std::numeric_limits<double>::infinity();
};

// In the network's order.
struct DescriptorJoint {
  std::string name;
  int line = 0;
  double neutral = 0.0;          // the default pose [rad]
  double kp = 0.0, kd = 0.0;     // [N m/rad], [N m s/rad]
  std::optional<double> effort;  // the target is moved until the torque at the tick is within it [N m]
  // Scale of its output [rad]; none: it is not moved by the network, but by the reference.
  std::optional<double> action;
  std::optional<ActionRange> clip{};  // of its output; none: the one of all actions
  bool around_reference = false;      // its action is added to the reference's angle instead of the default pose
};

// A joint that a body may have and the network knows nothing of: it follows the reference.
struct OtherJoint {
  std::string name;
  int line = 0;
  double kp = 0.0, kd = 0.0;
};

// The range of commands in one direction.
struct CommandRange {
  double lower = 0.0, upper = 0.0;
  double steps_from = 0.0;  // the smallest command that is answered by steps
};

// A controller that is told a velocity, not a pose (controllers/root_conversion.h).
struct VelocityInterface {
  CommandRange forward, lateral, yaw;  // [m/s], [m/s], [rad/s]
  CommandRange height{};               // [m]; lower == upper where the controller takes none
  double height_offset = 0.0;          // of the pelvis over the commanded height, measured [m]
  // Below it the network is told to stand: it is shown velocities of 0, a command_stand of 0 and clocks that hold.
  std::optional<StandBounds> stands_below{};
};

// A network that runs before the policy's own.
struct OtherNetwork {
  std::string name, file;
};

// The simulation of a network's makers, and how it stands there.
struct OwnPhysics {
  std::optional<double> dt;      // physics step [s]
  std::optional<double> height;  // of the base where it stands [m]
};

struct Descriptor {
  std::string file;  // where it was read, for messages
  std::string name, about, licence;
  std::string robot;                     // card: a name (robots/robot_cards.h) or a path
  std::string network;                   // file name
  std::vector<OtherNetwork> networks{};  // those that run before it, in their order
  double rate_hz = kTickRate;            // at which the network acts: kTickRate, a whole part of it or a whole multiple
  bool walks = false;
  bool waist_locked = false;  // unless the option says otherwise
  std::vector<DescriptorJoint> joints;
  std::vector<OtherJoint> other_joints;
  ObservationLayout observation;
  std::string output;  // of the network; "" for its only one
  int output_line = 0;
  double action_clip = std::numeric_limits<double>::infinity();  // of the output's size, before its scale
  bool within_limits = false;  // targets of joints with an action are kept within the robot's limits
  std::optional<VelocityInterface> command;
  std::optional<OwnPhysics> own_physics;  // for the audit

  [[nodiscard]] int actions() const;                             // joints with an action
  [[nodiscard]] std::vector<ActionRange> action_ranges() const;  // one for each action
  [[nodiscard]] int ticks_per_act() const;                       // of 50 Hz, 1 where it acts more often
  [[nodiscard]] int acts_per_tick() const;                       // 1 where it acts less often
  [[nodiscard]] double period() const { return 1.0 / rate_hz; }  // [s]
  [[nodiscard]] ChannelWidths widths() const { return {.joints = 0, .actions = actions()}; }
  [[nodiscard]] int input_size(const ObservationInput& input) const;
  [[nodiscard]] std::vector<LayoutBlock> layout(const ObservationInput& input) const;
  // "command_velocity 0..2, command_height 3, ... (6 frames of 76)": how input_size comes about.
  [[nodiscard]] std::string input_layout(const ObservationInput& input) const;
};

// Throws InputError("FILE:LINE: ...") as YamlSection does.
Descriptor parse_descriptor(const std::string& text, const std::string& file);
Descriptor read_descriptor(const std::string& path);

}  // namespace duet
