// A whole-body controller: 36-D reference and robot state -> joint command, at rate_hz (50). Knows nothing of engines.
#pragma once

#include <map>
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
};

}  // namespace duet
