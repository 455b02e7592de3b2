#include "duet/experiment/suite/suite.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/suite/suite_names.h"

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

const SuiteController& controller_of(const Suite& suite, const std::string& name) {
  return find_named(suite.controllers, "controller", name);
}
SuitePolicy policy_of(const Suite& suite, const std::string& name) {
  const bool control = name == kNullPolicy || std::ranges::find(suite.controls, name) != suite.controls.end();
  return control ? SuitePolicy{name} : find_named(suite.policies, "policy", name);
}
Perturbation perturbation_of(const Suite& suite, const std::string& name) {
  return name == kCleanName ? Perturbation{} : find_named(suite.perturbations, "perturbation", name);
}
std::vector<std::string> controller_names_of(const Suite& suite) { return names_of(suite.controllers); }
std::vector<std::string> policy_names_of(const Suite& suite) { return names_of(suite.policies); }
std::vector<std::string> perturbation_names_of(const Suite& suite) { return names_of(suite.perturbations); }

void clear_tags(Suite& suite) {
  for (SuiteReference& reference : suite.references) reference.tags.clear();
  for (SuitePolicy& policy : suite.policies) policy.tags.clear();
  for (Perturbation& perturbation : suite.perturbations) perturbation.tags.clear();
}

void require_clips(const Suite& suite) {
  if (!suite.clips.given) return;
  throw InputError(
      fmt::format("{}: its clips are not part of duet: expected --clips PATH (a data set of `duet dataset retarget`, "
                  "or clips of two people) or -s 'clips.files=[PATH]', found none",
                  suite.file));
}

}  // namespace duet
