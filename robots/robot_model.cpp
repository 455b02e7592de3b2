#include "duet/robots/robot_model.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

template <typename Entries>
int index_of(const Entries& entries, const char* kind, std::string_view name) {
  for (size_t i = 0; i < entries.size(); ++i)
    if (entries[i].name == name) return static_cast<int>(i);
  throw std::invalid_argument(unknown_name_message(kind, name, names_of(entries)));
}

}  // namespace

std::vector<std::string> RobotModel::joint_names() const { return names_of(joints); }

Eigen::VectorXd RobotModel::lower() const {
  Eigen::VectorXd values(dof());
  for (int j = 0; j < dof(); ++j) values[j] = joints[j].lower;
  return values;
}

Eigen::VectorXd RobotModel::upper() const {
  Eigen::VectorXd values(dof());
  for (int j = 0; j < dof(); ++j) values[j] = joints[j].upper;
  return values;
}

int RobotModel::joint_index(std::string_view joint) const { return index_of(joints, "joint", joint); }
int RobotModel::frame_index(std::string_view frame) const { return index_of(frames, "frame", frame); }
int RobotModel::keypoint_index(std::string_view keypoint) const { return index_of(keypoints, "keypoint", keypoint); }

int RobotModel::track_frame(std::string_view track) const {
  const auto it = tracks.find(std::string(track));
  if (it != tracks.end()) return it->second;
  std::vector<std::string> known;
  for (const auto& [known_name, frame] : tracks) known.push_back(known_name);
  throw std::invalid_argument(unknown_name_message("track", track, known));
}

double RobotModel::total_mass() const {
  double mass = 0.0;
  for (const RobotLink& link : links) mass += link.mass;
  return mass;
}

const StanceSize& RobotModel::stance_size() const {
  require(stance.has_value(), "robot '{}': expected 'stance' in its card, found none", name);
  return *stance;
}

const RootBounds& RobotModel::bounds_of_root() const {
  require(root_bounds.has_value(), "robot '{}': expected 'root_bounds' in its card, found none", name);
  return *root_bounds;
}

const Eigen::VectorXd* RobotModel::pose(std::string_view pose) const {
  const auto found = roles.poses.find(std::string(pose));
  return found == roles.poses.end() ? nullptr : &found->second;
}

bool has_fallen(const RobotState& state, const FallRule& rule) {
  const double cos_tilt = (state.X_WB.R * Eigen::Vector3d::UnitZ()).z();
  return state.X_WB.p.z() < rule.height || cos_tilt < rule.cos_tilt;
}

RobotState RobotModel::standing_state(const Pose& X_WB) const {
  RobotState state;
  state.X_WB = {yaw_rotation(yaw_of(X_WB.R)), {X_WB.p.x(), X_WB.p.y(), standing_height}};
  state.q = neutral;
  state.v = Eigen::VectorXd::Zero(dof());
  return state;
}

JointCommand RobotModel::default_command(const Eigen::VectorXd& q_target) const {
  require(q_target.size() == dof(), "default command of '{}': expected {} joint targets, found {}", name, dof(),
          q_target.size());
  JointCommand command{q_target, Eigen::VectorXd(dof()), Eigen::VectorXd(dof()), Eigen::VectorXd::Zero(dof())};
  for (int j = 0; j < dof(); ++j) {
    command.kp[j] = joints[j].kp;
    command.kd[j] = joints[j].kd;
  }
  return command;
}

void require_made_for(const std::string& made_for, const RobotModel& robot, const std::string& file) {
  if (made_for != robot.name)
    throw InputError(fmt::format("{}: made for '{}', the robot is '{}'", file, excerpt(made_for), robot.name));
}

std::shared_ptr<const RobotModel> load_shared_robot(const std::string& name_or_path) {
  return std::make_shared<const RobotModel>(
      load_robot(name_or_path.empty() ? default_card_path() : card_path(name_or_path)));
}

RobotModel with_origin_at(RobotModel robot, const Eigen::Vector3d& p_B) {
  robot.links.front().com -= p_B;
  for (std::size_t i = 1; i < robot.links.size(); ++i)
    if (robot.links[i].parent == 0) robot.links[i].X_PL.p -= p_B;
  for (RobotFrame& frame : robot.frames)
    if (frame.link == 0) frame.X_LF.p -= p_B;
  for (RobotShape& shape : robot.shapes)
    if (shape.link == 0) shape.X_LS.p -= p_B;
  robot.standing_height += p_B.z();
  return robot;
}

Eigen::Vector3d urdf_origin(const RobotModel& robot) {
  const auto base = std::ranges::find(robot.frames, robot.links.front().name, &RobotFrame::name);
  return base == robot.frames.end() || base->link != 0 ? Eigen::Vector3d::Zero() : base->X_LF.p;
}

}  // namespace duet
