#include "duet/controllers/pd.h"

namespace duet {
namespace {

class Pd final : public Controller {
 public:
  explicit Pd(const std::shared_ptr<const RobotModel>& robot) : gains_(robot->default_command(robot->neutral)) {}

  [[nodiscard]] std::string_view name() const override { return "pd"; }
  void reset(const RobotState&) override {}

  void act(const RobotState&, const Reference& reference, JointCommand& command) override {
    command.q_target = reference.q;
    command.kp = gains_.kp;
    command.kd = gains_.kd;
    command.tau_ff = gains_.tau_ff;
  }

 private:
  JointCommand gains_;
};

}  // namespace

std::unique_ptr<Controller> make_pd_controller(
    std::shared_ptr<const RobotModel> robot) {  // NOLINT(performance-unnecessary-value-param): as all makers
  return std::make_unique<Pd>(robot);
}

}  // namespace duet
