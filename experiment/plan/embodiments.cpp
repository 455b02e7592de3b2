#include "duet/experiment/plan/embodiments.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/experiment/plan/actuation_limits.h"
#include "duet/experiment/suite/suite.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/policy.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/roles.h"
#include "duet/rows/episode_row.h"

namespace duet {
namespace {

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// A policy that ships or was registered.
PolicyLoader by_name(const std::string& use) {
  return [use](std::shared_ptr<const RobotModel> robot, const PolicyOptions& options) {
    return policy_maker(use, std::move(robot), options);
  };
}

// Clips and policies are of the nominal robot: one without any of its joints would be told nothing.
void require_joints_of(const RobotModel& nominal, const RobotModel& robot, const std::string& controller) {
  const std::vector<std::string> known = nominal.joint_names();
  const auto is_known = [&](const RobotJoint& joint) { return contains(known, joint.name); };
  if (known.empty() || robot.joints.empty() || std::ranges::any_of(robot.joints, is_known)) return;
  throw InputError(
      fmt::format("controller '{}' runs on robot '{}', which has no joint in common with '{}', the robot of "
                  "the clips: expected a suite with 'robot: {}'",
                  controller, robot.name, nominal.name, robot.name));
}

bool is_played_back(const std::vector<std::string>& engines) {
  return std::ranges::all_of(engines, [](const std::string& engine) { return engine == kPlaybackEngine; });
}

// Requires what every episode of the suite needs of the robot's card: now, not after the physics of the first one.
void require_parts_of(const Suite& suite, const RobotModel& robot, const std::string& card) {
  std::vector<std::string> lacks;
  if (suite.references.empty()) {
    for (const char* track : {"head", "lhand", "rhand", "torso", "lshoulder", "rshoulder"})
      if (!robot.tracks.contains(track)) lacks.push_back(fmt::format("tracks: {}", track));
    for (const char* hand : {"left_hand", "right_hand"})
      if (std::ranges::find(robot.keypoints, hand, &Keypoint::name) == robot.keypoints.end())
        lacks.push_back(fmt::format("keypoints: {}", hand));
    if (robot.pairs.empty()) lacks.emplace_back("pairs");
  }
  if (robot.feet.empty() && !is_played_back(suite.engines)) lacks.emplace_back("shapes with sole: true");
  if (lacks.empty()) return;
  throw InputError(fmt::format("{}: robot '{}': expected what suite '{}' needs of a robot, found no {}", card,
                               robot.name, suite.name, fmt::join(lacks, ", ")));
}

bool has_explicit_law(const Suite& suite) {
  const auto is_explicit = [](const std::optional<TorqueLaw>& law) { return law == TorqueLaw::kExplicit; };
  return std::ranges::any_of(suite.profile.engines, [&](const auto& one) { return is_explicit(one.second.law); }) ||
         std::ranges::any_of(suite.perturbations,
                             [&](const Perturbation& one) { return one.actuation && is_explicit(one.actuation->law); });
}

// Its descriptor was read with the suite, and is now.
void require_same_facts(const SuiteController& controller) {
  const ControllerInfo then = about(controller), now = controller_info(controller.use);
  if (then.robot != now.robot || then.walks != now.walks || names_of(then.options) != names_of(now.options))
    throw InputError(fmt::format("{}: was replaced since the suite was read: begin again", controller.use));
}

}  // namespace

Embodiments::Embodiments(const Suite& suite, const std::vector<std::string>& skipped_controllers,
                         const std::vector<std::string>& skipped_policies,
                         const std::map<std::string, PolicyLoader>& called) {
  require_allowed(programs_of(suite, skipped_policies), suite.allow_programs);
  const DigestReads reads(read_);
  if (scene_mode(suite.partner) == PartnerMode::kSolid) limits_ = load_contact_limits(suite.contact_limits_file());
  add(suite.card());
  for (const SuiteController& controller : suite.controllers) {
    ControllerOnBody& entry = controllers_[controller.name];
    entry.robot = nominal();
    if (contains(skipped_controllers, controller.name)) continue;
    try {
      load_controller_of(suite, controller);
    } catch (const MissingError& error) {
      entry.refusal = fmt::format("controller '{}' is absent: {}", controller.name, error.what());
      absent_[controller.name] = entry.refusal;
    }
  }
  for (const SuitePolicy& policy : suite.policies) {
    if (policy.name == kNullPolicy || contains(skipped_policies, policy.name)) continue;
    const auto own = called.find(policy.name);
    add_policy(policy, own == called.end() ? by_name(policy.use) : own->second);
  }
  for (const std::string& control : suite.controls)
    if (!contains(skipped_policies, control)) add_policy(SuitePolicy{control}, by_name(control));
  add_policy(SuitePolicy{kNullPolicy}, by_name(kNullPolicy));
}

// Made once to see whether it can be.
void Embodiments::load_controller_of(const Suite& suite, const SuiteController& controller) {
  require_same_facts(controller);
  const std::size_t place = add(suite.card_of(controller));
  const std::shared_ptr<const RobotModel> robot = bodies_[place].robot;
  if (!suite.is_commanded()) require_joints_of(*nominal(), *robot, controller.name);
  require_parts_of(suite, *robot, suite.card_of(controller));
  LoadedController loaded = load_controller(controller.use, robot, controller.options);
  const std::unique_ptr<Controller> made = loaded.make(controller.options);
  if (!is_played_back(suite.engines)) require_usable(*made, *robot, controller.name);
  take_notes(loaded.notes);
  if (has_explicit_law(suite))
    take_notes(actuation_notes(suite, controller.name, robot, standing_gains(*made, *robot)));
  for (const Perturbation& perturbation : suite.perturbations) check_perturbation(perturbation, *robot);
  controllers_[controller.name] = {robot, std::move(loaded)};
  place_[controller.name] = place;
}

// Maps a policy made for the nominal body, by the joints' names, to a body that it does not fit. Its files were read
// for the nominal body a moment ago; where they were not, they are broken, and what was thrown goes on.
void Embodiments::map_policy(const std::string& name, std::size_t place) {
  const PolicyMaker& make = policies_.at({name, 0}).make;
  if (place == 0 || !make) throw;
  policies_.at({name, place}).make = [make, made_for = nominal(), body = bodies_[place].robot] {
    return on_other_body(make(), made_for, *body);
  };
}

void Embodiments::add_policy(const SuitePolicy& policy, const PolicyLoader& load) {
  for (std::size_t place = 0; place < bodies_.size(); ++place) {
    PolicyOnBody& entry = policies_[{policy.name, place}];
    try {
      entry.make = load(bodies_[place].robot, policy.options);
    } catch (const MissingError& error) {
      entry.refusal = fmt::format("policy '{}' is absent: {}", policy.name, error.what());
      absent_policies_[policy.name] = entry.refusal;
    } catch (const InputError&) {
      map_policy(policy.name, place);
    } catch (const std::invalid_argument&) {
      map_policy(policy.name, place);
    }
  }
}

std::size_t Embodiments::add(const std::string& card) {
  const auto found = std::find_if(bodies_.begin(), bodies_.end(), [&](const Body& body) { return body.card == card; });
  if (found != bodies_.end()) return static_cast<std::size_t>(found - bodies_.begin());
  bodies_.push_back({card, load_shared_robot(card), {}});
  take_notes(robot_notes(card));
  return bodies_.size() - 1;
}

void Embodiments::take_notes(const std::vector<std::string>& notes) {
  for (const std::string& note : notes)
    if (!contains(notes_, note)) notes_.push_back(note);
}

void Embodiments::take_clips(std::vector<PairedMotion> clips) {
  for (std::size_t i = 1; i < bodies_.size(); ++i) {
    bodies_[i].clips = clips;
    for (PairedMotion& clip : bodies_[i].clips)
      if (clip.robot.frames() > 0) clip.robot = on_body(clip.robot, *bodies_[i].robot);
  }
  bodies_.front().clips = std::move(clips);
}

std::size_t Embodiments::place(const std::string& controller) const {
  const auto found = place_.find(controller);
  return found == place_.end() ? 0 : found->second;
}

const std::vector<PairedMotion>& Embodiments::clips(const std::string& controller) const {
  return bodies_[place(controller)].clips;
}

const PolicyOnBody* Embodiments::policy(const std::string& controller, const std::string& policy) const {
  const auto found = policies_.find({policy, place(controller)});
  return found == policies_.end() ? nullptr : &found->second;
}

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestCommand = 400;  // shown [bytes]

std::vector<fs::path> trusted_folders() {
  std::vector<fs::path> folders;
  const char* setting = std::getenv("DUET_TRUSTED_FOLDERS");
  std::istringstream list(setting == nullptr ? "" : setting);
  for (std::string folder; std::getline(list, folder, ':');)
    if (fs::path(folder).is_absolute()) folders.push_back(fs::weakly_canonical(folder));
  return folders;
}

bool lies_in(const fs::path& path, const fs::path& folder) {
  const auto [rest, unused] = std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  return rest == folder.end() || rest->empty();  // "/a/" ends with an empty part
}

std::string command_line(const std::vector<std::string>& command) {
  return excerpt(fmt::format("{}", fmt::join(command, " ")), kLongestCommand);
}

std::string action_of(const PolicyDescriptor& descriptor) {
  if (descriptor.command.empty()) return fmt::format("connects to '{}'", excerpt(descriptor.socket));
  return fmt::format("runs '{}' in '{}'", command_line(descriptor.command),
                     excerpt(descriptor.folder(), kLongestCommand));
}

}  // namespace

std::vector<NamedProgram> programs_of(const SuitePolicy& policy) {
  if (!policy.use.ends_with(".yaml")) return {};
  const PolicyDescriptor descriptor = read_policy_descriptor(policy.use);
  if (descriptor.kind != PolicyKind::kProcess) return {};
  return {{fmt::format("policy '{}'", excerpt(policy.name)), policy.use, action_of(descriptor),
           in_trusted_folder(policy.use)}};
}

NamedProgram program_in(const std::string& who, const std::string& file, const std::vector<std::string>& command) {
  const std::string folder = fs::absolute(file).parent_path().lexically_normal().string();
  return {who, file, fmt::format("runs '{}' in '{}'", command_line(command), excerpt(folder, kLongestCommand)),
          in_trusted_folder(file)};
}

std::vector<NamedProgram> programs_of(const Suite& suite, const std::vector<std::string>& skipped) {
  std::vector<NamedProgram> programs;
  for (const SuitePolicy& policy : suite.policies) {
    if (std::find(skipped.begin(), skipped.end(), policy.name) != skipped.end()) continue;
    for (NamedProgram& program : programs_of(policy)) programs.push_back(std::move(program));
  }
  return programs;
}

std::string describe(const NamedProgram& program) {
  return fmt::format("{} of {} {}", program.who, excerpt(program.file, kLongestCommand), program.action);
}

void require_allowed(const std::vector<NamedProgram>& programs, bool allowed) {
  std::vector<std::string> refused;
  for (const NamedProgram& program : programs)
    if (!allowed && !program.trusted) refused.push_back(describe(program));
  if (!refused.empty())
    throw InputError(fmt::format("expected --allow-programs, or a folder in DUET_TRUSTED_FOLDERS, for: {}",
                                 fmt::join(refused, "; ")));
}

bool in_trusted_folder(const std::string& descriptor) {
  std::error_code error;
  const fs::path file = fs::canonical(descriptor, error);
  if (error) return false;
  const fs::path folder = fs::canonical(fs::absolute(descriptor).parent_path(), error);
  if (error) return false;
  const std::vector<fs::path> trusted = trusted_folders();
  return std::any_of(trusted.begin(), trusted.end(),
                     [&](const fs::path& root) { return lies_in(file, root) && lies_in(folder, root); });
}

}  // namespace duet
