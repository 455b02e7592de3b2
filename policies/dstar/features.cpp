#include "duet/policies/dstar/features.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <vector>

#include "duet/core/json.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/policies/frame_channels.h"

namespace duet {
namespace {

constexpr double kLongestWave = 4.0;  // [m]; each band halves it

// Where the person looks: level, at right angles to the line of the hips.
double heading_of(const Eigen::Matrix<double, 3, kSmplJoints>& joints) {
  const Eigen::Vector3d left = joints.col(kLeftHip) - joints.col(kRightHip);
  return std::atan2(-left.x(), left.y());
}

void write_waves(const Eigen::Vector3d& vector, float* out) {
  for (int axis = 0; axis < 3; ++axis) {
    double wave = kLongestWave;
    for (int band = 0; band < kPositionBands; ++band, wave *= 0.5) {
      const double angle = 2.0 * std::numbers::pi * vector[axis] / wave;
      *out++ = static_cast<float>(std::sin(angle));
      *out++ = static_cast<float>(std::cos(angle));
    }
  }
}

void write_harmonics(double angle, float* out) {
  for (int order = 1; order <= 3; ++order) {
    *out++ = static_cast<float>(std::sin(order * angle));
    *out++ = static_cast<float>(std::cos(order * angle));
  }
}

const std::vector<Channel>& dstar_channels() {
  static const std::vector<Channel> channels = frame_channels(ChannelKind::kJointPosition);
  return channels;
}

void add_parts(const std::string& name, std::initializer_list<const char*> parts, std::vector<std::string>& names) {
  for (const char* part : parts) names.push_back(name + part);
}

void add_names(ChannelKind kind, const RobotModel& robot, std::vector<std::string>& names) {
  const std::string name = channel_name(kind, ChannelFormat::kNetwork);
  switch (kind) {
    case ChannelKind::kPartnerJoints:
      for (const std::string_view joint : kSmplNames)
        add_parts(fmt::format("{}.{}", name, joint), {".x", ".y", ".z"}, names);
      return;
    case ChannelKind::kJointPosition:
    case ChannelKind::kJointVelocity:
      for (const std::string& joint : robot.joint_names()) names.push_back(fmt::format("{}.{}", name, joint));
      return;
    case ChannelKind::kRootOrientation:
      return add_parts(name, {".w", ".x", ".y", ".z"}, names);
    default:
      return add_parts(name, {".x", ".y", ".z"}, names);
  }
}

}  // namespace

std::vector<std::string> channel_names(const RobotModel& robot) {
  std::vector<std::string> names;
  names.reserve(kFrameSize);
  for (const Channel& channel : dstar_channels()) add_names(channel.kind, robot, names);
  return names;
}

Pose ego_frame(const RobotState& state) {
  return {yaw_rotation(yaw_of(state.X_WB.R)), {state.X_WB.p.x(), state.X_WB.p.y(), 0.0}};
}

FeatureMaker::FeatureMaker(std::shared_ptr<const RobotModel> robot)
    : robot_(std::move(robot)),
      kinematics_(*robot_),
      head_(robot_->track_frame("head")),
      left_hand_(robot_->track_frame("lhand")),
      right_hand_(robot_->track_frame("rhand")) {
  const std::size_t channels = channel_names(*robot_).size();
  require(channels == kFrameSize, "robot '{}' gives {} channels of observation, expected {} (29 joints)", robot_->name,
          channels, kFrameSize);
}

void FeatureMaker::make(const Observation& observation, std::span<const ObservationFrame> past,
                        DstarFeatures& features) {
  const ObservationFrame& now = observation.now();
  const Pose X_WE = ego_frame(now.robot), X_EW = X_WE.inverse();
  const auto write = [&](const ObservationFrame& frame, float* out) {
    write_frame(dstar_channels(), FrameSenses::in_ego(frame, *robot_, {}, X_EW), {out, kFrameSize});
  };
  for (int i = 0; i < kHistoryFrames; ++i) {
    write(observation.history[i], features.frames.col(i).data());
    write(past[i], features.past.col(i).data());
  }

  kinematics_.update(now.robot.X_WB, now.robot.q);
  const Eigen::Vector3d head = kinematics_.frame_position(head_), left = kinematics_.frame_position(left_hand_),
                        right = kinematics_.frame_position(right_hand_);
  const auto& person = now.partner;
  const std::array<Eigen::Vector3d, kRelations> relations = {
      person.col(kPelvis) - now.robot.X_WB.p, person.col(kHead) - head,      person.col(kLeftHand) - left,
      person.col(kRightHand) - left,          person.col(kLeftHand) - right, person.col(kRightHand) - right};
  for (int i = 0; i < kRelations; ++i) {
    write_waves(X_EW.R * relations[i], features.position.data() + 6 * kPositionBands * i);
    features.distance[i] = static_cast<float>(relations[i].norm());
  }
  const Eigen::Vector3d to_partner = X_EW.R * relations[0];
  write_harmonics(std::atan2(to_partner.y(), to_partner.x()), features.orientation.data());
  write_harmonics(heading_of(person) - yaw_of(now.robot.X_WB.R), features.orientation.data() + 6);
}

void encode_plan(const Anchors& anchors, const Pose& X_WE, const RobotModel& robot, std::span<float> plan) {
  const Pose X_EW = X_WE.inverse();
  for (int k = 0; k < kAnchors; ++k) {
    const Pose X_EB = X_EW * anchors[k].X_WB;
    Eigen::Map<Eigen::Matrix<float, kAnchorSize, 1>> out(plan.data() + kAnchorSize * k);
    out << X_EB.p.cast<float>(), wxyz_of(X_EB.R).cast<float>(), (anchors[k].q - robot.neutral).cast<float>();
  }
}

Anchors decode_plan(std::span<const float> plan, const Pose& X_WE, const RobotModel& robot) {
  Anchors anchors;
  for (int k = 0; k < kAnchors; ++k) {
    const Eigen::Map<const Eigen::Matrix<float, kAnchorSize, 1>> in(plan.data() + kAnchorSize * k);
    const Pose X_EB{Eigen::Quaterniond(in[3], in[4], in[5], in[6]).normalized(), in.head<3>().cast<double>()};
    anchors[k].X_WB = X_WE * X_EB;
    anchors[k].q = robot.neutral + in.tail(kAnchorSize - 7).cast<double>();
    for (int i = 0; i < robot.dof(); ++i)
      anchors[k].q[i] = std::clamp(anchors[k].q[i], robot.joints[i].lower, robot.joints[i].upper);
  }
  return anchors;
}

namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr const char* kWhat = "configuration of D-STAR";

struct Size {
  const char* name;
  int DstarConfig::*value;
  int least, most;
};

// The bounds keep what a broken file can ask for small.
constexpr int kWidest = 8192, kDeepest = 64, kLongestStride = 500;
constexpr Size kSizes[] = {
    {"long_frames", &DstarConfig::long_frames, 1, kHistoryFrames},
    {"short_frames", &DstarConfig::short_frames, 1, kHistoryFrames},
    {"long_stride", &DstarConfig::long_stride, 1, kLongestStride},
    {"width", &DstarConfig::width, 1, kWidest},
    {"heads", &DstarConfig::heads, 1, kWidest},
    {"feedforward", &DstarConfig::feedforward, 1, kWidest},
    {"layers", &DstarConfig::layers, 1, kDeepest},
    {"stream", &DstarConfig::stream, 1, kWidest},
    {"temporal", &DstarConfig::temporal, 1, kWidest},
    {"tokens", &DstarConfig::tokens, 1, kWidest},
    {"phase_hidden", &DstarConfig::phase_hidden, 1, kWidest},
    {"phase", &DstarConfig::phase, 1, kWidest},
    {"zone", &DstarConfig::zone, 1, kWidest},
    {"orientation", &DstarConfig::orientation, 1, kWidest},
    {"field", &DstarConfig::field, 1, kWidest},
    {"field_hidden", &DstarConfig::field_hidden, 1, kWidest},
    {"fusion_heads", &DstarConfig::fusion_heads, 1, kWidest},
    {"spatial", &DstarConfig::spatial, 1, kWidest},
    {"language", &DstarConfig::language, 1, kWidest},
    {"condition", &DstarConfig::condition, 1, kWidest},
    {"channels", &DstarConfig::channels, 1, kWidest},
    {"blocks", &DstarConfig::blocks, 1, kDeepest},
    {"groups", &DstarConfig::groups, 1, kWidest},
    {"step_embedding", &DstarConfig::step_embedding, 2, kWidest},
    {"training_steps", &DstarConfig::training_steps, 1, kWidest},
    {"inference_steps", &DstarConfig::inference_steps, 1, kWidest},
};

struct Switch {
  const char* name;
  bool DstarConfig::*value;
};

constexpr Switch kSwitches[] = {
    {"phase_attention", &DstarConfig::phase_attention},
    {"spatial_reasoning", &DstarConfig::spatial_reasoning},
    {"short_stream", &DstarConfig::short_stream},
    {"language_on", &DstarConfig::language_on},
};

struct Division {
  const char* name;
  int DstarConfig::*value;
  const char* by_name;
  int DstarConfig::*by;
};

constexpr Division kDivisions[] = {
    {"width", &DstarConfig::width, "heads", &DstarConfig::heads},
    {"temporal", &DstarConfig::temporal, "tokens", &DstarConfig::tokens},
    {"field", &DstarConfig::field, "fusion_heads", &DstarConfig::fusion_heads},
    {"channels", &DstarConfig::channels, "groups", &DstarConfig::groups},
};

std::vector<std::string> known_names() {
  std::vector<std::string> names = names_of(kSizes);
  for (const Switch& one : kSwitches) names.emplace_back(one.name);
  return names;
}

[[noreturn]] void refuse(const std::string& file, const std::string& problem) {
  throw InputError(fmt::format("{}: {}: {}", file, kWhat, problem));
}

const OrderedJson& json_field(const OrderedJson& json, const char* name, const std::string& file) {
  const auto found = json.find(name);
  if (found == json.end()) refuse(file, fmt::format("expected a field '{}', found none", name));
  return *found;
}

int parse_size(const OrderedJson& json, const Size& size, const std::string& file) {
  const OrderedJson& value = json_field(json, size.name, file);
  const bool fits = value.is_number_integer() && value >= size.least && value <= size.most;
  if (!fits)
    refuse(file, fmt::format("'{}': expected a whole number from {} to {}, found {}", size.name, size.least, size.most,
                             excerpt(dumped(value))));
  return value.get<int>();
}

bool parse_switch(const OrderedJson& json, const Switch& one, const std::string& file) {
  const OrderedJson& value = json_field(json, one.name, file);
  if (!value.is_boolean())
    refuse(file, fmt::format("'{}': expected true or false, found {}", one.name, excerpt(dumped(value))));
  return value.get<bool>();
}

}  // namespace

std::string config_problem(const DstarConfig& config) {
  for (const Size& size : kSizes)
    if (const int value = config.*size.value; value < size.least || value > size.most)
      return fmt::format("'{}': expected a whole number from {} to {}, found {}", size.name, size.least, size.most,
                         value);
  for (const Division& division : kDivisions)
    if (config.*division.value % (config.*division.by) != 0)
      return fmt::format("'{}': expected a multiple of '{}' ({}), found {}", division.name, division.by_name,
                         config.*division.by, config.*division.value);
  if (config.step_embedding % 2 != 0)
    return fmt::format("'step_embedding': expected an even number, found {}", config.step_embedding);
  if (config.inference_steps > config.training_steps)
    return fmt::format("'inference_steps': expected at most 'training_steps' ({}), found {}", config.training_steps,
                       config.inference_steps);
  return "";
}

std::string to_json_text(const DstarConfig& config) {
  OrderedJson json = OrderedJson::object();
  for (const Size& size : kSizes) json[size.name] = config.*size.value;
  for (const Switch& one : kSwitches) json[one.name] = config.*one.value;
  return dumped(json);
}

DstarConfig parse_dstar_config(const std::string& text, const std::string& file) {
  const OrderedJson json = parse_json(text, fmt::format("{}: {}", file, kWhat));
  if (!json.is_object()) refuse(file, fmt::format("expected a JSON object, found {}", json.type_name()));
  const std::vector<std::string> known = known_names();
  for (const auto& item : json.items())
    if (std::ranges::find(known, item.key()) == known.end())
      refuse(file, unknown_name_message("field", item.key(), known));
  DstarConfig config;
  for (const Size& size : kSizes) config.*size.value = parse_size(json, size, file);
  for (const Switch& one : kSwitches) config.*one.value = parse_switch(json, one, file);
  if (const std::string problem = config_problem(config); !problem.empty()) refuse(file, problem);
  return config;
}

}  // namespace duet
