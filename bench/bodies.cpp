#include "duet/bench/bodies.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/bench/suite_names.h"
#include "duet/bench/trust.h"
#include "duet/controllers/registry.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/policies/on_other_body.h"
#include "duet/robots/joint_map.h"

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

}  // namespace

std::string card_of(const Suite& suite, const SuiteController& controller) {
  if (!suite.robot.empty()) return suite.robot;
  const std::string robot = controller_info(controller.use).robot;
  return robot.empty() ? default_card_path() : card_path(robot);
}

Bodies::Bodies(const Suite& suite, const std::vector<std::string>& skipped_controllers,
               const std::vector<std::string>& skipped_policies, const std::map<std::string, PolicyLoader>& called) {
  require_allowed(programs_of(suite, skipped_policies), suite.allow_programs);
  add(suite.robot.empty() ? default_card_path() : suite.robot);
  for (const SuiteController& controller : suite.controllers) {
    if (contains(skipped_controllers, controller.name)) continue;
    try {
      const std::size_t place = add(card_of(suite, controller));
      if (suite.references.empty()) require_joints_of(*nominal(), *bodies_[place].robot, controller.name);
      static_cast<void>(make_controller(controller.use, bodies_[place].robot, controller.options));
      for (const Perturbation& perturbation : suite.perturbations)
        check_perturbation(perturbation, *bodies_[place].robot);
      place_[controller.name] = place;
    } catch (const MissingError& error) {
      absent_[controller.name] = fmt::format("controller '{}' is absent: {}", controller.name, error.what());
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

// What was made for the nominal body goes by the joints' names on one that it does not fit. Its files were read for the
// nominal body a moment ago; where they were not, they are broken, and what was thrown goes on.
void Bodies::map_policy(const std::string& name, std::size_t place) {
  const PolicyMaker& make = policies_.at({name, 0}).make;
  if (place == 0 || !make) throw;
  policies_.at({name, place}).make = [make, made_for = nominal(), body = bodies_[place].robot] {
    return on_other_body(make(), made_for, *body);
  };
}

void Bodies::add_policy(const SuitePolicy& policy, const PolicyLoader& load) {
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

std::size_t Bodies::add(const std::string& card) {
  const auto found = std::find_if(bodies_.begin(), bodies_.end(), [&](const Body& body) { return body.card == card; });
  if (found != bodies_.end()) return static_cast<std::size_t>(found - bodies_.begin());
  bodies_.push_back({card, load_shared_robot(card), {}});
  return bodies_.size() - 1;
}

void Bodies::take_clips(std::vector<PairedMotion> clips) {
  for (std::size_t i = 1; i < bodies_.size(); ++i) {
    bodies_[i].clips = clips;
    for (PairedMotion& clip : bodies_[i].clips)
      if (clip.robot.frames() > 0) clip.robot = on_body(clip.robot, *bodies_[i].robot);
  }
  bodies_.front().clips = std::move(clips);
}

std::size_t Bodies::place(const std::string& controller) const {
  const auto found = place_.find(controller);
  return found == place_.end() ? 0 : found->second;
}

const std::shared_ptr<const RobotModel>& Bodies::robot(const std::string& controller) const {
  return bodies_[place(controller)].robot;
}

const std::vector<PairedMotion>& Bodies::clips(const std::string& controller) const {
  return bodies_[place(controller)].clips;
}

const PolicyOnBody& Bodies::policy(const std::string& controller, const std::string& policy) const {
  return policies_.at({policy, place(controller)});
}

}  // namespace duet
