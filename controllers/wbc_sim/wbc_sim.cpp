#include "duet/controllers/wbc_sim/wbc_sim.h"

#include <algorithm>
#include <iterator>
#include <string_view>

#include "duet/core/option.h"
#include "duet/core/require.h"
#include "duet/core/share.h"

namespace duet {
namespace {

class WbcSim final : public Controller {
 public:
  WbcSim(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const WbcNetwork> network)
      : robot_(std::move(robot)),
        network_(std::move(network)),
        policy_(*network_),
        tracker_(robot_, network_->gait),
        observer_(network_->kind, robot_->dof()) {
    action_.setZero(robot_->dof());
  }

  [[nodiscard]] std::string_view name() const override { return "wbc_sim"; }

  void reset(const RobotState&) override {
    action_.setZero();
    observer_.reset();
    started_ = false;
  }

  void act(const RobotState& state, const Reference& reference, JointCommand& command) override {
    if (started_)
      tracker_.update(state, reference);
    else
      tracker_.reset(reference);
    read_sensors(state, tracker_, sensors_);
    started_ = true;
    action_ = policy_.act(observer_.update(sensors_, action_));
    fill(command);
  }

 private:
  void fill(JointCommand& command) const {
    command.q_target.resize(robot_->dof());
    for (int i = 0; i < robot_->dof(); ++i)
      command.q_target[i] = std::clamp(tracker_.q()[i] + network_->action_scale[i] * static_cast<double>(action_[i]),
                                       robot_->joints[i].lower, robot_->joints[i].upper);
    command.kp = network_->kp;
    command.kd = network_->kd;
    command.tau_ff.setZero(robot_->dof());
  }

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const WbcNetwork> network_;  // shared: many episodes run one network
  WbcPolicy policy_;
  WbcTracker tracker_;
  WbcObserver observer_;
  WbcSensors sensors_;
  Eigen::VectorXf action_;
  bool started_ = false;
};

constexpr std::string_view kShipped[] = {"braced", "student", "braced_oracle", "oracle"};

struct WbcSimOptions {
  std::string network = "braced";
};

const FieldTable<WbcSimOptions>& wbc_sim_options() {
  static const FieldTable<WbcSimOptions> table = {field<WbcSimOptions>(
      {.name = "network",
       .meaning =
           "braced (learnt with pushes, steps out of them), student (the one before, which did not), braced_oracle or "
           "oracle (which see the base velocity), or the path of a network"},
      &WbcSimOptions::network)};
  return table;
}

}  // namespace

std::unique_ptr<Controller> make_wbc_sim_controller(std::shared_ptr<const RobotModel> robot,
                                                    std::shared_ptr<const WbcNetwork> network) {
  require(network->joints == robot->joint_names(), "wbc_sim: the network was made for other joints than the robot's");
  return std::make_unique<WbcSim>(std::move(robot), std::move(network));
}

std::string wbc_sim_network_path(const ControllerOptions& options) {
  std::string network = read_options("controller", "wbc_sim", wbc_sim_options(), options).network;
  if (std::ranges::find(kShipped, network) == std::end(kShipped)) return network;
  return share_file("network of WBC-Sim", "controllers/wbc_sim/" + network + ".safetensors");
}

ControllerInfo wbc_sim_info() {
  return {"wbc_sim",
          "WBC-Sim of the supplement, trained by `duet train wbc`: stands, steps and tracks the whole reference", "g1",
          true, option_list<ControllerOption>(wbc_sim_options())};
}

}  // namespace duet
