#include "duet/controllers/audit/self_consistency.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "duet/controllers/descriptor_controller.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

constexpr int kShownTicks = 60, kSettlingTicks = 10;  // of the movement, and those before it is looked at

Eigen::Quaterniond mirrored(const Eigen::Quaterniond& R) { return {R.w(), -R.x(), R.y(), -R.z()}; }

// A movement that a walker may well see: joints swing by 0.1 rad around neutral, the base leans and turns a little.
// Amplitudes and rates are of no consequence as long as left and right differ.
RobotState movement_at(const RobotModel& robot, int tick) {
  const double t = tick * kTick;
  RobotState state = robot.standing_state();
  for (int j = 0; j < robot.dof(); ++j) {
    const double rate = 2.0 + 7.0 * std::abs(std::sin(1.3 * (j + 1))), phase = 2.1 * j;
    state.q[j] += 0.1 * std::sin(rate * t + phase);
    state.v[j] = 0.1 * rate * std::cos(rate * t + phase);
  }
  const double roll = 0.06 * std::sin(4.0 * t + 0.3), pitch = 0.06 * std::sin(5.0 * t + 1.1);
  state.X_WB.R = Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
  state.w_WB_B = {0.24 * std::cos(4.0 * t + 0.3), 0.3 * std::cos(5.0 * t + 1.1), 0.3 * std::sin(3.0 * t)};
  state.v_WB = {0.3 + 0.1 * std::sin(6.0 * t), 0.15 * std::cos(4.0 * t), 0.05 * std::sin(8.0 * t)};
  return state;
}

}  // namespace

namespace {

using NetworkPool = std::vector<std::unique_ptr<Network>>;

// A network of a pool, to which it goes back.
class PooledNetwork final : public Network {
 public:
  PooledNetwork(std::unique_ptr<Network> network, std::shared_ptr<NetworkPool> pool)
      : network_(std::move(network)), pool_(std::move(pool)) {}
  ~PooledNetwork() override { pool_->push_back(std::move(network_)); }
  PooledNetwork(const PooledNetwork&) = delete;
  PooledNetwork& operator=(const PooledNetwork&) = delete;
  [[nodiscard]] std::span<const Port> inputs() const override { return network_->inputs(); }
  [[nodiscard]] std::span<const Port> outputs() const override { return network_->outputs(); }
  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    network_->run(inputs, outputs);
  }
  void reset() override { network_->reset(); }

 private:
  std::unique_ptr<Network> network_;
  std::shared_ptr<NetworkPool> pool_;
};

}  // namespace

ControllerOfReading controllers_of_network(const std::shared_ptr<const RobotModel>& robot, const NetworkMaker& network,
                                           const std::string& network_path) {
  return [=, pool = std::make_shared<NetworkPool>()](const Descriptor& descriptor, const ControllerOptions& options) {
    std::unique_ptr<Network> free;
    if (pool->empty()) {
      free = network();
    } else {
      free = std::move(pool->back());
      pool->pop_back();
    }
    auto pooled = std::make_unique<PooledNetwork>(std::move(free), pool);
    return make_guarded(make_descriptor_controller(descriptor, robot, std::move(pooled), network_path, options), robot);
  };
}

Eigen::VectorXd mirrored_joints(const RobotModel& robot, const Eigen::VectorXd& q) {
  Eigen::VectorXd image(q.size());
  for (int j = 0; j < robot.dof(); ++j) image[robot.roles.counterpart[j]] = mirror_sign(robot, j) * q[j];
  return image;
}

RobotState mirrored(const RobotModel& robot, const RobotState& state) {
  RobotState image = state;
  image.X_WB.p.y() = -state.X_WB.p.y();
  image.X_WB.R = mirrored(state.X_WB.R);
  image.v_WB.y() = -state.v_WB.y();
  image.w_WB_B = mirrored_axis(state.w_WB_B);
  image.q = mirrored_joints(robot, state.q);
  image.v = mirrored_joints(robot, state.v);
  return image;
}

Descriptor with_mirrored_clocks(Descriptor descriptor) {
  for (ChannelGroup& group : descriptor.observation.groups)
    for (Channel& channel : group.channels) {
      if (channel.kind != ChannelKind::kGaitSine && channel.kind != ChannelKind::kGaitCosine) continue;
      if (channel.gait.phases.size() == 1) channel.gait.phases[0] += std::numbers::pi;
      std::ranges::reverse(channel.gait.phases);
      std::ranges::reverse(channel.gait.standing);
    }
  return descriptor;
}

double asymmetry(const Descriptor& descriptor, const RobotModel& robot, const ControllerOfReading& make) {
  const bool told = descriptor.command.has_value();
  const auto options = [&](const char* command) {
    return told ? ControllerOptions{{"command", command}} : ControllerOptions{};
  };
  const auto plain = make(descriptor, options("0.4,0.1,0.2"));
  const auto image = make(with_mirrored_clocks(descriptor), options("0.4,-0.1,-0.2"));
  const RobotState start = robot.standing_state();
  plain->reset(start);
  image->reset(start);
  std::vector<Eigen::VectorXd> targets, images;
  const auto act = [&](Controller& controller, const RobotState& state, std::vector<Eigen::VectorXd>& out) {
    JointCommand command = robot.default_command(robot.neutral);
    for (int i = 0; i < controller.acts_per_tick(); ++i) controller.act(state, {start.X_WB, robot.neutral}, command);
    out.push_back(command.q_target);
  };
  for (int tick = 0; tick < kShownTicks; ++tick) {
    const RobotState state = movement_at(robot, tick);
    act(*plain, state, targets);
    act(*image, mirrored(robot, state), images);
  }
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(robot.dof());
  for (int t = kSettlingTicks; t < kShownTicks; ++t) mean += targets[t] / (kShownTicks - kSettlingTicks);
  double difference = 0.0, size = 0.0;
  for (int t = kSettlingTicks; t < kShownTicks; ++t) {
    difference += (images[t] - mirrored_joints(robot, targets[t])).squaredNorm();
    size += (targets[t] - mean).squaredNorm();
  }
  return size > 0.0 ? std::sqrt(difference / size) : 0.0;
}

namespace {

constexpr double kJointStep = 0.02;  // [rad]

ControllerOptions standing_options(const Descriptor& descriptor) {
  return descriptor.command ? ControllerOptions{{"command", "0,0,0"}} : ControllerOptions{};
}

// The targets of the first act in a state.
Eigen::VectorXd first_targets(Controller& controller, const RobotModel& robot, const RobotState& state) {
  const RobotState start = robot.standing_state();
  JointCommand command = robot.default_command(robot.neutral);
  controller.reset(start);
  controller.act(state, {start.X_WB, robot.neutral}, command);
  return command.q_target;
}

}  // namespace

JointFigure farthest_first_target(const Descriptor& descriptor, const RobotModel& robot,
                                  const ControllerOfReading& make) {
  const auto controller = make(descriptor, standing_options(descriptor));
  const Eigen::VectorXd targets = first_targets(*controller, robot, robot.standing_state());
  JointFigure most;
  for (const DescriptorJoint& joint : descriptor.joints) {
    const double distance = std::abs(targets[robot.joint_index(joint.name)] - joint.neutral);
    if (joint.action && distance >= most.value) most = {joint.name, distance};
  }
  return most;
}

JointFigure strongest_following(const Descriptor& descriptor, const RobotModel& robot,
                                const ControllerOfReading& make) {
  const auto controller = make(descriptor, standing_options(descriptor));
  const RobotState still = robot.standing_state();
  const Eigen::VectorXd before = first_targets(*controller, robot, still);
  JointFigure most{"", -1e9};
  for (const DescriptorJoint& joint : descriptor.joints) {
    if (!joint.action) continue;
    const int j = robot.joint_index(joint.name);
    RobotState state = still;
    state.q[j] += kJointStep;
    const double followed = (first_targets(*controller, robot, state)[j] - before[j]) / kJointStep;
    if (followed > most.value) most = {joint.name, followed};
  }
  return most;
}

}  // namespace duet
