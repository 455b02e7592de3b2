#include "bench/bodies.h"

#include <fmt/format.h>

#include <algorithm>

#include "bench/suite_names.h"
#include "core/require.h"
#include "core/share.h"

namespace duet {
namespace {

std::string card_of(const Suite& suite, const SuiteController& controller) {
  if (!suite.robot.empty()) return suite.robot;
  const std::string robot = controller_info(controller.use).robot;
  return robot.empty() ? default_card_path() : card_path(robot);
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

RobotMotion on_body(const RobotMotion& motion, const RobotModel& body) {
  if (motion.joint_names == body.joint_names()) return motion;
  RobotMotion moved = motion;
  moved.joint_names = body.joint_names();
  moved.q = body.neutral.replicate(1, motion.q.cols());
  for (int j = 0; j < body.dof(); ++j) {
    const auto found = std::find(motion.joint_names.begin(), motion.joint_names.end(), moved.joint_names[j]);
    if (found != motion.joint_names.end()) moved.q.row(j) = motion.q.row(found - motion.joint_names.begin());
  }
  return moved;
}

Bodies::Bodies(const Suite& suite, const std::vector<std::string>& skipped_controllers,
               const std::vector<std::string>& skipped_policies) {
  add(suite.robot.empty() ? default_card_path() : suite.robot);
  for (const SuiteController& controller : suite.controllers) {
    if (contains(skipped_controllers, controller.name)) continue;
    try {
      const std::size_t place = add(card_of(suite, controller));
      static_cast<void>(make_controller(controller.use, bodies_[place].robot, controller.options));
      for (const Perturbation& perturbation : suite.perturbations)
        check_perturbation(perturbation, *bodies_[place].robot);
      place_[controller.name] = place;
    } catch (const MissingError& error) {
      absent_[controller.name] = fmt::format("controller '{}' is absent: {}", controller.name, error.what());
    }
  }
  for (const SuitePolicy& policy : suite.policies)
    if (policy.name != kNullPolicy && !contains(skipped_policies, policy.name)) add_policy(policy);
  add_policy(SuitePolicy{kNullPolicy});
}

// A network that is not of the nominal body is a mistake of the suite; one that is, need not fit every other body.
void Bodies::add_policy(const SuitePolicy& policy) {
  for (std::size_t place = 0; place < bodies_.size(); ++place) {
    PolicyOnBody& entry = policies_[{policy.name, place}];
    try {
      entry.make = policy_maker(policy.use, bodies_[place].robot, policy.options);
    } catch (const MissingError& error) {
      entry.refusal = fmt::format("policy '{}' is absent: {}", policy.name, error.what());
      absent_policies_[policy.name] = entry.refusal;
    } catch (const std::exception& error) {
      if (place == 0) throw;
      entry.refusal =
          fmt::format("policy '{}' on robot '{}': {}", policy.name, bodies_[place].robot->name, error.what());
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
    for (PairedMotion& clip : bodies_[i].clips) clip.robot = on_body(clip.robot, *bodies_[i].robot);
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
