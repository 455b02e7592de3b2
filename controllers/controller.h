// A whole-body controller: 36-D reference and robot state -> joint command, at rate_hz (50). Knows nothing of engines.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/loaded_file.h"
#include "core/robot_state.h"
#include "robots/robot_model.h"

namespace duet {

// What a suite may set of one controller, by name ("network", "waist", ...); values as written there.
using ControllerOptions = std::map<std::string, std::string>;

// How often a controller met a number that is not finite, and what it did (controllers/guard.h).
struct ControllerFaults {
  int observations = 0;  // ticks on which the state or the reference was not finite
  int actions = 0;       // ticks on which the command was not finite
  bool stopped = false;  // the safe stop was entered
};

class Controller {
 public:
  virtual ~Controller() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  // Starts an episode in `state`, which it is to keep upright.
  virtual void reset(const RobotState& state) = 0;
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
  std::string robot;  // the card it was made for, robots/g1/<robot>.yaml; rollouts use that body
  bool walks = false;
  std::vector<ControllerOption> options;
};

// Those that ship with duet: "pd", "vmc", "wbc_sim", "homie", "twist2", "playground", "rl_gym", ... A name that ends in
// ".yaml" is the path of an IO descriptor (controllers/descriptor.h) and as good as one of them.
std::vector<ControllerInfo> controllers();
std::vector<std::string> controller_names();
ControllerInfo controller_info(const std::string& name);
// Every file that such a controller loads, its card aside, in a fixed order. Throws as make_controller for a name that
// is unknown, a descriptor that is broken and a network that is not on this machine; the files are not read.
LoadedFiles controller_files(const std::string& name, const ControllerOptions& options = {});
// Throws std::invalid_argument for an option that it does not have, with the nearest and all known.
void check_controller_options(const ControllerInfo& info, const ControllerOptions& options);

// Throws std::invalid_argument for an unknown name or option (with the nearest and all known) and a robot whose joints
// are not those it was made for (by name); MissingError where its network is not on this machine (naming the places
// looked at and the option that sets it); InputError for a network that is broken or of another kind.
std::unique_ptr<Controller> make_controller(const std::string& name, const std::shared_ptr<const RobotModel>& robot,
                                            const ControllerOptions& options = {});

}  // namespace duet
