#include "duet/experiment/suite/suite.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/suite/suite_names.h"
#include "duet/metrics/contact_limits.h"
#include "duet/robots/robot_model.h"

namespace duet {
namespace {

template <typename Item>
std::vector<std::string> names_of(const std::vector<Item>& items) {
  std::vector<std::string> names;
  names.reserve(items.size());
  for (const Item& item : items) names.push_back(item.name);
  return names;
}

template <typename Item>
const Item& find_named(const std::vector<Item>& items, const char* kind, const std::string& name) {
  const auto found = std::find_if(items.begin(), items.end(), [&](const Item& item) { return item.name == name; });
  require(found != items.end(), unknown_name_message(kind, name, names_of(items)));
  return *found;
}

}  // namespace

std::size_t SuiteClips::copies() const {
  return std::max<std::size_t>(1, variants.size()) * (roles == ClipRoles::kBoth ? 2 : 1);
}

void vary(const ClipVariant& variant, SynthesisOptions& options) {
  options.side = variant.side;
  options.target_height = variant.target_height;
  if (variant.distance) options.distance = variant.distance;
  if (variant.outcome) options.outcome = variant.outcome;
}

Tags tags_of(const ClipVariant& variant) {
  Tags tags;
  if (variant.side) tags.emplace(kSideTag, name_of(side_names(), *variant.side));
  if (variant.target_height) tags.emplace(kHeightTag, fmt::format("{}", *variant.target_height));
  return tags;
}

bool Suite::runs_in(std::string_view engine) const { return std::ranges::find(engines, engine) != engines.end(); }

const SuiteController& Suite::controller(const std::string& name) const {
  return find_named(controllers, "controller", name);
}

SuitePolicy Suite::policy(const std::string& name) const {
  const bool control = name == kNullPolicy || std::ranges::find(controls, name) != controls.end();
  return control ? SuitePolicy{name} : find_named(policies, "policy", name);
}

Perturbation Suite::perturbation(const std::string& name) const {
  return name == kCleanName ? Perturbation{} : find_named(perturbations, "perturbation", name);
}

std::vector<std::string> Suite::controller_names() const { return names_of(controllers); }
std::vector<std::string> Suite::policy_names() const { return names_of(policies); }
std::vector<std::string> Suite::perturbation_names() const { return names_of(perturbations); }

std::string Suite::card() const { return robot.empty() ? default_card_path() : robot; }

std::string Suite::card_of(const SuiteController& controller) const {
  if (!robot.empty()) return robot;
  const std::string made_for = about(controller).robot;
  return made_for.empty() ? default_card_path() : card_path(made_for);
}

std::string Suite::contact_limits_file() const {
  return contact_limits.empty() ? default_contact_limits_path() : contact_limits;
}

StartMode Suite::start_of(const SuiteController& controller) const {
  switch (start) {
    case SuiteStart::kClip:
      return StartMode::kClip;
    case SuiteStart::kApproach:
      return StartMode::kApproach;
    case SuiteStart::kAct:
      return StartMode::kAct;
    case SuiteStart::kSimToReal:
      return StartMode::kSimToReal;
    case SuiteStart::kAuto:
      break;
  }
  return about(controller).walks ? StartMode::kApproach : StartMode::kAct;
}

Readings Suite::metric_readings() const {
  Readings chosen;
  for (const auto& [option, value] : readings) set_reading(chosen, option, value);
  return chosen;
}

std::vector<Task> Suite::tasks_of_own_clips() const {
  if (is_commanded()) return std::vector<Task>(references.size(), Task::kHug);
  std::vector<Task> own;
  const std::size_t per_task = clips.synth_per_task * clips.copies();
  for (const Task task : tasks) own.insert(own.end(), per_task, task);
  return own;
}

void Suite::clear_tags() {
  for (SuiteReference& reference : references) reference.tags.clear();
  for (SuitePolicy& policy : policies) policy.tags.clear();
  for (Perturbation& perturbation : perturbations) perturbation.tags.clear();
}

void Suite::require_clips() const {
  if (!clips.given) return;
  throw InputError(
      fmt::format("{}: its clips are not part of duet: expected --clips PATH (a data set of `duet dataset retarget`, "
                  "or clips of two people) or -s 'clips.files=[PATH]', found none",
                  file));
}

}  // namespace duet
