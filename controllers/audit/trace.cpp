#include "duet/controllers/audit/trace.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "duet/archives/csv.h"
#include "duet/archives/npy/npz.h"
#include "duet/controllers/descriptor_controller.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kUnitNorm = 1e-3;  // by which a recorded quaternion's length may differ from 1
constexpr int kMostColumns = 4096;  // of an observation

// Columns by name, all of one length.
class TraceTable {
 public:
  explicit TraceTable(std::string name) : name_(std::move(name)) {}

  void add(const std::string& column, std::vector<double> values) {
    if (!columns_.empty() && values.size() != rows())
      fail(fmt::format("'{}': expected {} rows, found {}", excerpt(column), rows(), values.size()));
    if (!columns_.emplace(column, std::move(values)).second)
      fail(fmt::format("expected each column once, found '{}' again", excerpt(column)));
  }
  [[nodiscard]] std::size_t rows() const { return columns_.empty() ? 0 : columns_.begin()->second.size(); }
  [[nodiscard]] const std::vector<double>* find(const std::string& column) const {
    const auto found = columns_.find(column);
    return found == columns_.end() ? nullptr : &found->second;
  }
  [[nodiscard]] const std::vector<double>& at(const std::string& column) const {
    const std::vector<double>* values = find(column);
    if (values == nullptr) fail(fmt::format("expected a column '{}', found none", column));
    return *values;
  }
  [[noreturn]] void fail(const std::string& fault) const {
    throw InputError(fmt::format("'{}': trace of a controller: {}", name_, fault));
  }

 private:
  std::string name_;
  std::map<std::string, std::vector<double>> columns_;
};

TraceTable csv_table(const std::string& bytes, const std::string& name) {
  CsvReader rows(bytes, name);
  TraceTable table(name);
  if (!rows.next()) table.fail("expected a header and rows, found neither");
  const std::vector<std::string> header(rows.fields().begin(), rows.fields().end());
  std::vector<std::vector<double>> values(header.size());
  while (rows.next()) {
    if (rows.blank()) continue;
    if (rows.fields().size() != header.size())
      rows.fail(fmt::format("expected {} fields, found {}", header.size(), rows.fields().size()));
    for (std::size_t c = 0; c < header.size(); ++c) {
      const std::optional<double> number = rows.number(rows.fields()[c]);
      if (!number)
        rows.fail(fmt::format("column '{}': expected a finite number, found '{}'", excerpt(header[c]),
                              excerpt(rows.fields()[c])));
      values[c].push_back(*number);
    }
  }
  for (std::size_t c = 0; c < header.size(); ++c) table.add(header[c], std::move(values[c]));
  return table;
}

// The columns of an array of numbers, (rows, columns), under names.
void add_array(const Npz& archive, const std::string& key, const std::vector<std::string>& names, TraceTable& table) {
  const std::vector<double> values = archive.numbers(key, {-1, static_cast<long>(names.size())});
  for (std::size_t c = 0; c < names.size(); ++c) {
    std::vector<double> column;
    for (std::size_t at = c; at < values.size(); at += names.size()) column.push_back(values[at]);
    table.add(names[c], std::move(column));
  }
}

std::vector<std::string> numbered(const std::string& stem, std::size_t count) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.push_back(fmt::format("{}.{}", stem, i));
  return names;
}

std::size_t width_of(const Npz& archive, const std::string& key) {
  const NpyArray& array = archive.array(key);
  return array.shape.size() == 2 ? array.shape[1] : 0;
}

TraceTable npz_table(const std::string& bytes, const std::string& name) {
  const Npz archive = Npz::parse(bytes, name);
  TraceTable table(name);
  add_array(archive, "quat_wxyz", {"quat_w", "quat_x", "quat_y", "quat_z"}, table);
  add_array(archive, "gyro", {"gyro_x", "gyro_y", "gyro_z"}, table);
  if (archive.contains("velocity")) add_array(archive, "velocity", {"velocity_x", "velocity_y", "velocity_z"}, table);
  std::vector<std::string> command = {"command_forward", "command_lateral", "command_yaw_rate"};
  if (width_of(archive, "command") == 4) command.emplace_back("command_height");
  add_array(archive, "command", command, table);
  const std::vector<std::string> joints = archive.strings("joint_names", {-1});
  for (const char* key : {"q", "v", "target"}) {
    if (std::string_view(key) == "target" && !archive.contains(key)) continue;
    std::vector<std::string> names;
    for (const std::string& joint : joints) names.push_back(fmt::format("{}.{}", key, joint));
    add_array(archive, key, names, table);
  }
  for (const char* key : {"obs", "action"})
    if (archive.contains(key))
      add_array(archive, key, numbered(key, std::min<std::size_t>(width_of(archive, key), kMostColumns)), table);
  return table;
}

Eigen::Vector3d vector_at(const TraceTable& table, const std::string& stem, std::size_t row) {
  return {table.at(stem + "_x")[row], table.at(stem + "_y")[row], table.at(stem + "_z")[row]};
}

RobotState state_at(const TraceTable& table, const RobotModel& robot, const Descriptor& descriptor, std::size_t row) {
  RobotState state = robot.standing_state();
  const Eigen::Quaterniond R(table.at("quat_w")[row], table.at("quat_x")[row], table.at("quat_y")[row],
                             table.at("quat_z")[row]);
  if (std::abs(R.norm() - 1.0) > kUnitNorm)
    table.fail(fmt::format("row {}: expected a unit quaternion in 'quat_w' to 'quat_z', found a length of {:.4g}",
                           row + 1, R.norm()));
  state.X_WB.R = R.normalized();
  state.w_WB_B = vector_at(table, "gyro", row);
  if (table.find("velocity_x") != nullptr) state.v_WB = vector_at(table, "velocity", row);
  for (const DescriptorJoint& joint : descriptor.joints) {
    const int r = robot.joint_index(joint.name);
    state.q[r] = table.at("q." + joint.name)[row];
    state.v[r] = table.at("v." + joint.name)[row];
  }
  return state;
}

// The columns of these names as a matrix; none of them: no columns.
Eigen::MatrixXd matrix_of(const TraceTable& table, const std::vector<std::string>& names) {
  if (names.empty() || table.find(names[0]) == nullptr) return {};
  Eigen::MatrixXd matrix(table.rows(), names.size());
  for (std::size_t c = 0; c < names.size(); ++c)
    matrix.col(static_cast<Eigen::Index>(c)) =
        Eigen::Map<const Eigen::VectorXd>(table.at(names[c]).data(), matrix.rows());
  return matrix;
}

const ObservationInput& shown_input(const Descriptor& descriptor) { return descriptor.observation.inputs[0]; }

// A network that keeps what it was shown and what it answered.
struct Seen {
  std::vector<float> shown, answered;
};

class SpiedNetwork final : public Network {
 public:
  SpiedNetwork(std::unique_ptr<Network> network, std::shared_ptr<Seen> seen, std::size_t input, std::size_t output)
      : network_(std::move(network)), seen_(std::move(seen)), input_(input), output_(output) {}
  [[nodiscard]] std::span<const Port> inputs() const override { return network_->inputs(); }
  [[nodiscard]] std::span<const Port> outputs() const override { return network_->outputs(); }
  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    seen_->shown.assign(inputs[input_].begin(), inputs[input_].end());
    network_->run(inputs, outputs);
    seen_->answered.assign(outputs[output_].begin(), outputs[output_].end());
  }
  void reset() override { network_->reset(); }

 private:
  std::unique_ptr<Network> network_;
  std::shared_ptr<Seen> seen_;
  std::size_t input_, output_;
};

// The names of the numbers of the first input: "joint_velocity of 'left_knee_joint'", with the frame where it has many.
std::vector<std::string> number_names(const Descriptor& descriptor) {
  std::vector<std::string> names;
  for (const InputPart& part : shown_input(descriptor).parts) {
    for (int i = 0; i < part.size; ++i) names.push_back(fmt::format("{} {}", part.from, i));
    for (int frame = 0; frame < part.history.frames; ++frame)
      for (const int g : part.groups)
        for (const Channel& channel : descriptor.observation.groups[g].channels) {
          const int size = channel_size(channel, descriptor.widths());
          for (int i = 0; i < size; ++i) {
            std::string name = channel_name(channel.kind, ChannelFormat::kController);
            if (!channel.joints.empty())
              name += fmt::format(" of '{}'", descriptor.joints[channel.joints[i]].name);
            else if (size > 1)
              name += fmt::format(" {}", i);
            if (part.history.frames > 1) name += fmt::format(" in frame {} of {}", frame + 1, part.history.frames);
            names.push_back(std::move(name));
          }
        }
  }
  return names;
}

bool agrees(double own, double other) {
  return std::abs(own - other) <= kTraceTolerance * std::max(1.0, std::abs(other));
}

double difference(double own, double other) {
  const double size = std::abs(own - other) / std::max(1.0, std::abs(other));
  return std::isfinite(size) ? size : std::numeric_limits<double>::infinity();
}

// How a column of the trace is made of our own: the same numbers at another place, times a factor, with an offset.
std::string pattern_of(const Eigen::MatrixXd& own, const Eigen::MatrixXd& trace, Eigen::Index place,
                       const std::vector<std::string>& names) {
  const Eigen::VectorXd mine = own.col(place), theirs = trace.col(place);
  const auto matches = [](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    for (Eigen::Index i = 0; i < a.size(); ++i)
      if (!agrees(a[i], b[i])) return false;
    return true;
  };
  const bool moves = (mine.array() - mine[0]).abs().maxCoeff() > 1e-3;
  if (moves) {
    for (Eigen::Index other = 0; other < trace.cols(); ++other)
      if (other != place && matches(mine, trace.col(other)))
        return fmt::format("number {} ({}) stands at place {} of the trace", place, names[place], other);
    const double factor = mine.dot(theirs) / std::max(mine.squaredNorm(), 1e-30);
    if (matches(factor * mine, theirs))
      return fmt::format("number {} ({}) is {:.5g} times as large in the trace", place, names[place], factor);
  }
  const double offset = (theirs - mine).mean();
  if (matches((mine.array() + offset).matrix(), theirs))
    return fmt::format("number {} ({}) is larger by {:.5g} in the trace", place, names[place], offset);
  return fmt::format("number {} ({}) is another in the trace", place, names[place]);
}

// One act after another over the trace; matrices as those of a trace.
struct Replayed {
  Eigen::MatrixXd observations, actions, targets;
};

bool commands_change(const ControllerTrace& trace) {
  return std::ranges::any_of(trace.commands, [&](const VelocityCommand& c) {
    const VelocityCommand& first = trace.commands[0];
    return c.forward != first.forward || c.lateral != first.lateral || c.yaw_rate != first.yaw_rate ||
           c.height != first.height;
  });
}

}  // namespace

ControllerTrace parse_controller_trace(const std::string& bytes, const std::string& name, const Descriptor& descriptor,
                                       const RobotModel& robot) {
  if (!descriptor.command)
    throw InputError(
        fmt::format("{}: controller '{}': expected the key 'command' to be held against a trace, found none: a trace "
                    "has no reference",
                    descriptor.file, descriptor.name));
  const TraceTable table = bytes.starts_with("PK") ? npz_table(bytes, name) : csv_table(bytes, name);
  if (table.rows() == 0) table.fail("expected at least one row, found none");
  ControllerTrace trace;
  trace.file = name;
  const bool has_height = table.find("command_height") != nullptr;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    trace.states.push_back(state_at(table, robot, descriptor, row));
    trace.commands.push_back(
        {.forward = table.at("command_forward")[row],
         .lateral = table.at("command_lateral")[row],
         .yaw_rate = table.at("command_yaw_rate")[row],
         .height = has_height ? table.at("command_height")[row] : descriptor.command->height.upper});
  }
  std::vector<std::string> targets;
  for (const DescriptorJoint& joint : descriptor.joints)
    if (joint.action) targets.push_back("target." + joint.name);
  trace.observations =
      matrix_of(table, numbered("obs", static_cast<std::size_t>(descriptor.input_size(shown_input(descriptor)))));
  trace.actions = matrix_of(table, numbered("action", static_cast<std::size_t>(descriptor.actions())));
  trace.targets = matrix_of(table, targets);
  if (trace.actions.cols() == 0 && trace.targets.cols() == 0)
    table.fail("expected columns 'action.0', ... or 'target.JOINT', found neither");
  return trace;
}

ControllerTrace read_controller_trace(const std::string& path, const Descriptor& descriptor, const RobotModel& robot) {
  return parse_controller_trace(read_text(path), path, descriptor, robot);
}

namespace {

Replayed replay_trace(const Descriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
                      const NetworkMaker& network, const std::string& path, const ControllerTrace& trace) {
  const auto seen = std::make_shared<Seen>();
  const auto told = std::make_shared<VelocityCommand>(trace.commands[0]);
  std::unique_ptr<Network> made = network();
  const auto place_of = [](std::span<const Port> ports, const std::string& name) {
    const auto found = std::ranges::find(ports, name, &Port::name);
    return found == ports.end() ? std::size_t{0} : static_cast<std::size_t>(found - ports.begin());
  };
  const std::size_t input = place_of(made->inputs(), shown_input(descriptor).name),
                    output = place_of(made->outputs(), descriptor.output);
  auto spied = std::make_unique<SpiedNetwork>(std::move(made), seen, input, output);
  const bool fast = descriptor.acts_per_tick() > 1;
  if (fast && commands_change(trace))
    throw InputError(
        fmt::format("'{}': trace of a controller: expected one command in all rows for a controller that acts at {:g} "
                    "Hz, found several",
                    trace.file, descriptor.rate_hz));
  const VelocityCommand& first = trace.commands[0];
  const ControllerOptions options =
      fast ? ControllerOptions{{"command",
                                fmt::format("{},{},{},{}", first.forward, first.lateral, first.yaw_rate, first.height)}}
           : ControllerOptions{};
  const auto controller =
      make_descriptor_controller(descriptor, robot, std::move(spied), path, options, fast ? nullptr : told);
  Replayed out;
  out.observations.resize(trace.rows(), descriptor.input_size(shown_input(descriptor)));
  out.actions.resize(trace.rows(), descriptor.actions());
  out.targets.resize(trace.rows(), descriptor.actions());
  JointCommand command = robot->default_command(robot->neutral);
  controller->reset(trace.states[0]);
  for (int row = 0; row < trace.rows(); ++row) {
    *told = trace.commands[row];
    for (int i = 0; i < descriptor.ticks_per_act(); ++i)
      controller->act(trace.states[row], {robot->standing_state().X_WB, robot->neutral}, command);
    for (Eigen::Index i = 0; i < out.observations.cols(); ++i) out.observations(row, i) = seen->shown[i];
    Eigen::Index action = 0;
    for (const DescriptorJoint& joint : descriptor.joints) {
      if (!joint.action) continue;
      out.actions(row, action) = seen->answered[action];
      out.targets(row, action++) = command.q_target[robot->joint_index(joint.name)];
    }
  }
  return out;
}

double largest_difference(const Eigen::MatrixXd& own, const Eigen::MatrixXd& trace) {
  double most = 0.0;
  for (Eigen::Index row = 0; row < trace.rows(); ++row)
    for (Eigen::Index c = 0; c < trace.cols(); ++c) most = std::max(most, difference(own(row, c), trace(row, c)));
  return most;
}

// "row 1: action 3 ('left_knee_joint') is 0.2, in the trace 0.1"; "" where the two agree.
std::string first_difference(const Eigen::MatrixXd& own, const Eigen::MatrixXd& trace, const char* what,
                             const std::vector<std::string>& names) {
  for (Eigen::Index row = 0; row < trace.rows(); ++row)
    for (Eigen::Index c = 0; c < trace.cols(); ++c)
      if (!agrees(own(row, c), trace(row, c)))
        return fmt::format("row {}: {} {} ({}) is {:.6g}, in the trace {:.6g}", row + 1, what, c, names[c], own(row, c),
                           trace(row, c));
  return "";
}

}  // namespace

TraceAgreement compare_with_trace(const Descriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
                                  const NetworkMaker& network, const std::string& network_path,
                                  const ControllerTrace& trace) {
  const Replayed own = replay_trace(descriptor, robot, network, network_path, trace);
  TraceAgreement found;
  found.observation = largest_difference(own.observations, trace.observations);
  found.action = largest_difference(own.actions, trace.actions);
  found.target = largest_difference(own.targets, trace.targets);
  found.equal = std::max({found.observation, found.action, found.target}) <= kTraceTolerance;
  if (found.equal) return found;
  const std::vector<std::string> numbers = number_names(descriptor);
  std::vector<std::string> joints;
  for (const DescriptorJoint& joint : descriptor.joints)
    if (joint.action) joints.push_back(fmt::format("'{}'", joint.name));
  found.first = first_difference(own.observations, trace.observations, "number", numbers);
  if (found.first.empty()) found.first = first_difference(own.actions, trace.actions, "action", joints);
  if (found.first.empty()) found.first = first_difference(own.targets, trace.targets, "target", joints);
  for (Eigen::Index c = 0; c < trace.observations.cols(); ++c)
    if (largest_difference(own.observations.col(c), trace.observations.col(c)) > kTraceTolerance)
      found.patterns.push_back(pattern_of(own.observations, trace.observations, c, numbers));
  return found;
}

Eigen::MatrixXd observations_of_trace(const Descriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
                                      const NetworkMaker& network, const std::string& network_path,
                                      const ControllerTrace& trace) {
  return replay_trace(descriptor, robot, network, network_path, trace).observations;
}

}  // namespace duet
