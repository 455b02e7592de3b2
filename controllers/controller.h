// A whole-body controller: 36-D reference and robot state -> joint command, at 50 Hz or a multiple of it. Knows nothing
// of engines.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/episode_facts.h"
#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The options that a suite may set of one controller, by name ("network", "waist", ...); values as written there.
using ControllerOptions = std::map<std::string, std::string>;

class Controller {
 public:
  virtual ~Controller() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  // Starts an episode in `state`, which it is to keep upright.
  virtual void reset(const RobotState& state) = 0;
  // Calls of act() in a control period of 20 ms, evenly spaced, all with the reference of their tick.
  [[nodiscard]] virtual int acts_per_tick() const { return 1; }
  // Fills `command` (sized by the first call or by RobotModel::default_command). No allocation after the first call.
  virtual void act(const RobotState& state, const Reference& reference, JointCommand& command) = 0;
  [[nodiscard]] virtual ControllerFaults faults() const { return {}; }  // since reset
};

struct ControllerOption {
  std::string name, fallback, about;  // fallback: the value that holds where none is given
};

struct ControllerInfo {
  std::string name;
  std::string about;  // one sentence for `duet list controllers`
  std::string robot;  // the card it was made for, by name or path; rollouts use that body. "": any
  bool walks = false;
  std::vector<ControllerOption> options;
  // Default angles of the joints that it leaves to the reference: the pose in which it was made to walk [rad].
  std::map<std::string, double> posture = {};
};

// Keeps numbers that are not finite away from the motors, whatever the controller does. Wraps any controller; every
// one that make_controller returns is wrapped.

// Ticks (at 50 Hz) for which the last finite command is held before the safe stop.
inline constexpr int kGuardHeldTicks = 5;
// Ticks over which the safe stop takes the card's kp down to 0; kd is the card's throughout.
inline constexpr int kGuardRampTicks = 25;

// A tick on which the state or the reference is not finite does not reach `controller`. On it, and on one whose command
// is not finite, the last finite command stands (before the first: the angles measured at reset with the card's gains)
// for kGuardHeldTicks in a row (as many calls more as it acts in a tick). After that comes the safe stop, for good:
// targets at the angles last measured, kp falling to 0 over kGuardRampTicks, the card's kd. reset() clears all of it.
// Throws std::invalid_argument in act() for a state or a reference of another robot's size, and in reset() for a state
// that is not finite.
std::unique_ptr<Controller> make_guarded(std::unique_ptr<Controller> controller,
                                         const std::shared_ptr<const RobotModel>& robot);

// Ticks that a controller is tried in before its first episode.
inline constexpr int kTriedTicks = 5;

// Lets `controller`, guarded, act in the robot's standing pose, as long as that takes to know it. Throws InputError
// where a command is not finite, and where the quickest of kTriedTicks first ticks computes for longer than a tick:
// what else a busy machine does is not counted. One that throws is left to the episode, which says where. `name` is for
// messages.
void require_usable(Controller& controller, const RobotModel& robot, const std::string& name);

// With kd at most `most` [N m s/rad], one per joint; all else is `controller`'s. Wraps any controller.
std::unique_ptr<Controller> make_damped_at_most(std::unique_ptr<Controller> controller, Eigen::VectorXd most);

// A controller whose arms something else moves, as a teleoperated robot's are: the targets of all joints of both arms
// are the reference's angles; gains, the other joints and what it is shown are `controller`'s. Wraps any controller.
// Throws std::invalid_argument for a robot without arms that move.
std::unique_ptr<Controller> make_reference_arms(std::unique_ptr<Controller> controller, const RobotModel& robot);

// The card's gains around the reference's joint angles and nothing else: no balance. It falls within about a second and
// says so in the table; what stands longer is the other controllers' merit.
std::unique_ptr<Controller> make_pd_controller(std::shared_ptr<const RobotModel> robot);

}  // namespace duet
