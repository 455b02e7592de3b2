#include "duet/controllers/reference_arms.h"

#include <utility>
#include <vector>

#include "duet/core/require.h"

namespace duet {
namespace {

class ReferenceArms final : public Controller {
 public:
  ReferenceArms(std::unique_ptr<Controller> controller, std::vector<int> joints)
      : controller_(std::move(controller)), joints_(std::move(joints)) {}

  [[nodiscard]] std::string_view name() const override { return controller_->name(); }
  [[nodiscard]] int acts_per_tick() const override { return controller_->acts_per_tick(); }
  [[nodiscard]] ControllerFaults faults() const override { return controller_->faults(); }
  void reset(const RobotState& state) override { controller_->reset(state); }
  void act(const RobotState& state, const Reference& reference, JointCommand& command) override {
    controller_->act(state, reference, command);
    for (const int joint : joints_) command.q_target[joint] = reference.q[joint];
  }

 private:
  std::unique_ptr<Controller> controller_;
  std::vector<int> joints_;
};

}  // namespace

std::unique_ptr<Controller> make_reference_arms(std::unique_ptr<Controller> controller, const RobotModel& robot) {
  std::vector<int> joints;
  for (const std::vector<int>& arm : robot.roles.arms) joints.insert(joints.end(), arm.begin(), arm.end());
  require(!joints.empty(), "controller '{}': option 'arms': expected a robot with arms that move, found '{}'",
          controller->name(), robot.name);
  return std::make_unique<ReferenceArms>(std::move(controller), std::move(joints));
}

}  // namespace duet
