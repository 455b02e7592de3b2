#include "duet/controllers/wbc_sim/observation.h"

namespace duet {
namespace {

using Kinds = std::vector<ChannelKind>;

ChannelGroup group_of(const Kinds& kinds) {
  ChannelGroup group;
  for (const ChannelKind kind : kinds) group.channels.push_back({.kind = kind});
  return group;
}

ObservationInput input_of(std::vector<InputPart> parts) {
  return {.name = "", .line = 0, .parts = std::move(parts), .state = ""};
}

const Kinds& reference_kinds() {
  static const Kinds kinds = {ChannelKind::kReferenceJointPosition, ChannelKind::kReferenceJointVelocity,
                              ChannelKind::kRootPositionError, ChannelKind::kRootOrientationError};
  return kinds;
}

ObservationLayout oracle_layout() {
  const Kinds body = {ChannelKind::kJointPosition,      ChannelKind::kJointVelocity, ChannelKind::kBaseAngularVelocity,
                      ChannelKind::kBaseLinearVelocity, ChannelKind::kGravity,       ChannelKind::kPreviousAction};
  return {.groups = {group_of(body), group_of(reference_kinds())}, .inputs = {input_of({{.groups = {0, 1}}})}};
}

ObservationLayout student_layout() {
  const Kinds frame = {ChannelKind::kJointPosition, ChannelKind::kJointVelocity, ChannelKind::kBaseAngularVelocity,
                       ChannelKind::kGravity, ChannelKind::kPreviousAction};
  const HistoryRule past = {.frames = kWbcHistory, .current = false, .starts_full = true};
  return {.groups = {group_of(frame), group_of(reference_kinds())},
          .inputs = {input_of({{.groups = {0, 1}}, {.groups = {0}, .history = past}})}};
}

void show_sensors(ChannelKind kind, const WbcSensors& sensors, const Eigen::VectorXf& action, ChannelWriter& out) {
  switch (kind) {
    case ChannelKind::kJointPosition:
      return out(sensors.q);
    case ChannelKind::kJointVelocity:
      return out(sensors.v);
    case ChannelKind::kBaseAngularVelocity:
      return out(sensors.w);
    case ChannelKind::kBaseLinearVelocity:
      return out(sensors.velocity_B);
    case ChannelKind::kGravity:
      return out(sensors.gravity);
    case ChannelKind::kPreviousAction:
      return out(action);
    case ChannelKind::kReferenceJointPosition:
      return out(sensors.q_ref);
    case ChannelKind::kReferenceJointVelocity:
      return out(sensors.v_ref);
    case ChannelKind::kRootPositionError:
      return out(sensors.root_error);
    case ChannelKind::kRootOrientationError:
      return out(sensors.root_turn);
    default:
      throw std::logic_error("wbc_sim: a channel that it does not show");
  }
}

auto sensor_writer(const WbcSensors& sensors, const Eigen::VectorXf& action) {
  return [&](const Channel& channel, ChannelWriter& out) { show_sensors(channel.kind, sensors, action, out); };
}

Eigen::Matrix<double, 6, 1> two_columns(const Eigen::Matrix3d& R) {
  Eigen::Matrix<double, 6, 1> columns;
  columns << R.col(0), R.col(1);
  return columns;
}

}  // namespace

const ObservationLayout& wbc_observation(WbcKind kind) {
  static const ObservationLayout oracle = oracle_layout(), student = student_layout();
  return kind == WbcKind::kOracle ? oracle : student;
}

int WbcLayout::size(WbcKind kind) const {
  const ObservationLayout& layout = wbc_observation(kind);
  return layout.input_size(layout.inputs[0], widths());
}

std::vector<LayoutEntry> WbcLayout::channels(WbcKind kind) const {
  const ObservationLayout& layout = wbc_observation(kind);
  std::vector<LayoutEntry> channels;
  for (const LayoutBlock& block : layout.blocks(layout.inputs[0], widths(), ChannelFormat::kNetwork)) {
    if (block.frames > 1)
      channels.push_back({"history", block.frames * block.frame_size()});
    else
      channels.insert(channels.end(), block.entries.begin(), block.entries.end());
  }
  return channels;
}

void read_sensors(const RobotState& state, const WbcTracker& tracker, WbcSensors& sensors) {
  const Eigen::VectorXd& neutral = tracker.robot().neutral;
  const Eigen::Matrix3d R_BW = state.X_WB.R.toRotationMatrix().transpose();
  sensors.q = state.q - neutral;
  sensors.v = state.v;
  sensors.w = state.w_WB_B;
  sensors.velocity_B = R_BW * state.v_WB;
  sensors.gravity = -R_BW.col(2);
  sensors.q_ref = tracker.q() - neutral;
  sensors.v_ref = tracker.v();
  const Pose root = tracker.led_root();
  sensors.root_error = R_BW * (root.p - state.X_WB.p);
  const double distance = sensors.root_error.norm();
  if (distance > 1.0) sensors.root_error /= distance;
  sensors.root_turn = two_columns(R_BW * root.R.toRotationMatrix());
}

std::span<const float> WbcObserver::update(const WbcSensors& sensors, const Eigen::VectorXf& action) {
  writer_.update(sensor_writer(sensors, action));
  return writer_.input(0);
}

void write_oracle(const WbcSensors& sensors, const Eigen::VectorXf& action, std::span<float> out) {
  std::span<float> rest = out;
  const ChannelWidths widths = WbcLayout(static_cast<int>(sensors.q.size())).widths();
  for (const ChannelGroup& group : wbc_observation(WbcKind::kOracle).groups) {
    const auto size = static_cast<std::size_t>(channels_size(group.channels, widths));
    write_channels(group.channels, sensor_writer(sensors, action), rest.first(size));
    rest = rest.subspan(size);
  }
}

void write_bodies(const Kinematics& actual, const Pose& X_WRef, const std::vector<int>& links, std::span<float> out) {
  const Eigen::Matrix3d R_RefW = X_WRef.R.toRotationMatrix().transpose();
  ChannelWriter write(out);
  for (const int link : links) {
    write(Eigen::Vector3d(R_RefW * (actual.p_WL(link) - X_WRef.p)));
    write(two_columns(R_RefW * actual.R_WL(link)));
  }
}

}  // namespace duet
