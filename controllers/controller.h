// A whole-body controller: 36-D reference and robot state -> joint command, at rate_hz (50). Knows nothing of engines.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/robot_state.h"
#include "robots/robot_model.h"

namespace duet {

class Controller {
 public:
  virtual ~Controller() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  // Whether it can move the feet. Where not, episodes start at the act position (an option of the suite, printed).
  [[nodiscard]] virtual bool walks() const = 0;
  // Starts an episode in `state`, which it is to keep upright.
  virtual void reset(const RobotState& state) = 0;
  // Fills `command` (sized by the first call or by RobotModel::default_command). No allocation after the first call.
  virtual void act(const RobotState& state, const Reference& reference, JointCommand& command) = 0;
};

// "pd", "vmc". Throws std::invalid_argument for an unknown name (with the nearest and all known).
std::vector<std::string> controller_names();
std::unique_ptr<Controller> make_controller(const std::string& name, std::shared_ptr<const RobotModel> robot);

}  // namespace duet
