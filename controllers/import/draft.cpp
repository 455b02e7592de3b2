#include "duet/controllers/import/draft.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/robots/robot_cards.h"

namespace duet {
namespace {

// A term by all of its names, and its channels.
struct TermRow {
  const char* names;
  std::vector<const char*> channels;
};

const std::vector<TermRow>& term_table() {
  static const std::vector<TermRow> table = {
      {"base_lin_vel lin_vel", {"base_linear_velocity"}},
      {"base_ang_vel ang_vel imu_ang_vel", {"base_angular_velocity"}},
      {"projected_gravity gravity_vec", {"projected_gravity"}},
      {"velocity_commands keyboard_velocity_commands commands", {"command_velocity"}},
      {"command_lin_vel", {"command_velocity, axes: [0, 1]"}},
      {"command_ang_vel", {"command_velocity, axes: [2]"}},
      {"command_base_height", {"command_height"}},
      {"command_stand", {"command_stand"}},
      {"joint_pos joint_pos_rel dof_pos", {"joint_position"}},
      {"joint_vel joint_vel_rel dof_vel", {"joint_velocity"}},
      {"actions last_action", {"previous_action"}},
      {"sin_phase", {"gait_sine"}},
      {"cos_phase", {"gait_cosine"}},
      {"phase gait_phase", {"gait_sine", "gait_cosine"}},
      {"motion_command whole_body_tracking/motion_command", {"reference_joint_position", "reference_joint_velocity"}},
      {"motion_anchor_pos_b motion_ref_pos_b whole_body_tracking/motion_anchor_pos_b", {"anchor_position_error"}},
      {"motion_anchor_ori_b motion_ref_ori_b whole_body_tracking/motion_anchor_ori_b", {"anchor_orientation_error"}},
  };
  return table;
}

std::string scale_text(const std::vector<double>& scale) {
  if (scale.empty()) return "";
  const bool one = std::ranges::all_of(scale, [&](double value) { return value == scale.front(); });
  if (one && scale.front() == 1.0) return "";
  return one ? fmt::format(", scale: {:.9g}", scale.front()) : fmt::format(", scale: [{:.9g}]", fmt::join(scale, ", "));
}

std::string channel_text(const std::string& channel, const TermFacts& facts) {
  std::string text = channel;
  if (channel.starts_with("gait_") && !facts.clock.empty()) text += ", " + facts.clock;
  if (channel.starts_with("anchor_")) text += ", frame: " + facts.anchor;
  if (channel == "previous_action" && facts.clipped) text += ", clipped: true";
  text += scale_text(facts.scale);
  if (facts.clip < std::numeric_limits<double>::infinity()) text += fmt::format(", clip: {:.9g}", facts.clip);
  return text;
}

// A card that can be loaded; one whose description is not here is nobody's body.
std::shared_ptr<const RobotModel> load_quietly(const std::string& path) {
  try {
    return load_shared_robot(path);
  } catch (const InputError&) {
    return nullptr;
  }
}

}  // namespace

DraftTerm draft_term(const std::string& name, const TermFacts& facts, const std::string& file) {
  std::vector<std::string> known;
  for (const TermRow& row : term_table()) {
    std::istringstream names(row.names);
    for (std::string each; names >> each;) {
      known.push_back(each);
      if (each != name) continue;
      DraftTerm term{.name = name};
      for (const char* channel : row.channels) {
        if (std::string_view(channel).starts_with("anchor_") && facts.anchor.empty())
          throw InputError(
              fmt::format("'{}': term '{}': expected its body in the network's metadata "
                          "('anchor_body_name'), found none",
                          file, name));
        term.channels.push_back(channel_text(channel, facts));
      }
      return term;
    }
  }
  throw InputError(fmt::format("'{}': {}", file, unknown_name_message("term of an observation", name, known)));
}

int whole_number(double value, int least, int most, const std::string& key, const std::string& file) {
  if (!(value >= least && value <= most && value == std::floor(value)))
    throw InputError(
        fmt::format("'{}': expected a whole number from {} to {} in '{}', found {:g}", file, least, most, key, value));
  return static_cast<int>(value);
}

int joint_of(const RobotModel& robot, const std::string& name) {
  const auto found = std::ranges::find_if(
      robot.joints, [&](const RobotJoint& joint) { return plain_joint(joint.name) == plain_joint(name); });
  return found == robot.joints.end() ? -1 : static_cast<int>(found - robot.joints.begin());
}

DraftBody body_of(const std::vector<std::string>& joints, const std::string& card, const std::string& file) {
  DraftBody best;
  std::size_t best_same = 0;  // joints that have the very names
  std::string lacks;
  const auto consider = [&](const std::string& name, const std::shared_ptr<const RobotModel>& robot) {
    if (robot == nullptr) return;
    for (const std::string& joint : joints)
      if (joint_of(*robot, joint) < 0) {
        lacks = joint;
        return;
      }
    const auto same = static_cast<std::size_t>(std::ranges::count_if(joints, [&](const std::string& joint) {
      return std::ranges::find(robot->joints, joint, &RobotJoint::name) != robot->joints.end();
    }));
    if (best.robot != nullptr && (same < best_same || (same == best_same && robot->dof() >= best.robot->dof()))) return;
    best = {name, robot};
    best_same = same;
  };
  if (!card.empty())
    consider(card, load_shared_robot(card_path(card)));
  else
    for (const RobotCardFile& each : robot_cards()) consider(each.name, load_quietly(each.path));
  if (best.robot != nullptr) return best;
  throw InputError(
      fmt::format("'{}': expected joints of {}, found '{}', which it lacks{}", file,
                  card.empty() ? "a robot card" : "robot '" + card + "'", excerpt(lacks),
                  card.empty() ? " (--robot gives another card, `duet robot new` makes one of a URDF)" : ""));
}

DraftBody body_of(std::size_t joints, const std::string& card, const std::string& file, const std::string& path) {
  if (!card.empty()) {
    const auto robot = load_shared_robot(card_path(card));
    if (robot->joints.size() != joints)
      throw InputError(
          fmt::format("'{}': expected {} joints, those of robot '{}', found {}: --robot gives another card", file,
                      robot->joints.size(), card, joints));
    return {card, robot};
  }
  std::vector<RobotCardFile> cards = robot_cards();  // those of the robot that stands in first
  std::stable_partition(cards.begin(), cards.end(),
                        [folder = cards.empty() ? std::string() : cards.front().folder](const RobotCardFile& each) {
                          return each.folder == folder;
                        });
  const std::filesystem::path folders(path);
  std::stable_partition(cards.begin(), cards.end(), [&](const RobotCardFile& each) {
    return std::find(folders.begin(), folders.end(), each.name) != folders.end();
  });
  for (const RobotCardFile& each : cards)
    if (const auto robot = load_quietly(each.path); robot != nullptr && robot->joints.size() == joints)
      return {each.name, robot};
  throw InputError(
      fmt::format("'{}': expected a robot card of {} joints, found none (--robot gives one)", file, joints));
}

}  // namespace duet
