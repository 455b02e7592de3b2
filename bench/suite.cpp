#include "duet/bench/suite.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/bench/suite_names.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

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

std::string quoted(const std::string& text) {
  std::string escaped;
  for (const char c : text) escaped += c == '"' || c == '\\' ? std::string{'\\', c} : std::string{c};
  return '"' + escaped + '"';
}

std::string options_yaml(const std::map<std::string, std::string>& options) {
  std::vector<std::string> texts;
  texts.reserve(options.size());
  for (const auto& [name, value] : options) texts.push_back(fmt::format("{}: {}", name, quoted(value)));
  return fmt::format(", options: {{{}}}", fmt::join(texts, ", "));
}

// A plain controller or policy is its name.
std::string to_yaml(const SuiteController& controller) {
  if (controller.use == controller.name && controller.options.empty()) return controller.name;
  return fmt::format("{{name: {}, use: {}{}}}", controller.name, quoted(controller.use),
                     controller.options.empty() ? "" : options_yaml(controller.options));
}

std::string to_yaml(const SuitePolicy& policy) {
  const bool plain = policy.options.empty() && policy.prompt.empty() && !policy.shuffled_partner;
  if (policy.use == policy.name && plain) return policy.name;
  return fmt::format("{{name: {}, use: {}{}{}{}}}", policy.name, quoted(policy.use),
                     policy.options.empty() ? "" : options_yaml(policy.options),
                     policy.prompt.empty() ? "" : ", prompt: " + quoted(policy.prompt),
                     policy.shuffled_partner ? ", partner: shuffled" : "");
}

template <typename Item>
std::string list_yaml(const char* key, const std::vector<Item>& items) {
  std::vector<std::string> texts;
  texts.reserve(items.size());
  for (const Item& item : items) texts.push_back(to_yaml(item));
  return fmt::format("{}: [{}]\n", key, fmt::join(texts, ", "));
}

// A suite with nothing but the clean arm says nothing of perturbations.
std::string perturbations_yaml(const Suite& suite) {
  if (suite.perturbations.size() == 1 && suite.perturbations.front().name == kCleanName) return "";
  std::string text = "perturbations:\n";
  for (const Perturbation& perturbation : suite.perturbations) text += fmt::format("  - {}\n", to_yaml(perturbation));
  return text;
}

// Nothing where there are none.
std::string variants_yaml(const std::vector<ClipVariant>& variants) {
  if (variants.empty()) return "";
  std::vector<std::string> texts;
  texts.reserve(variants.size());
  for (const ClipVariant& variant : variants) {
    std::string text = "{name: " + variant.name;
    if (variant.side) text += fmt::format(", side: {}", name_of(side_names(), *variant.side));
    if (variant.target_height) text += fmt::format(", target_height: {}", *variant.target_height);
    texts.push_back(text + "}");
  }
  return fmt::format(", variants: [{}]", fmt::join(texts, ", "));
}

// As the profile says it; what it leaves to an engine's defaults is left to them here too.
std::string profile_yaml(const Profile& profile) {
  std::string text =
      fmt::format("profile:\n  name: {}\n  engines:{}\n", profile.name, profile.engines.empty() ? " {}" : "");
  for (const auto& [engine, settings] : profile.engines)
    text += fmt::format("    {}: {}\n", engine, settings_yaml(settings));
  return text;
}

}  // namespace

const SuiteController& controller_of(const Suite& suite, const std::string& name) {
  return find_named(suite.controllers, "controller", name);
}
SuitePolicy policy_of(const Suite& suite, const std::string& name) {
  return name == kNullPolicy ? SuitePolicy{name} : find_named(suite.policies, "policy", name);
}
Perturbation perturbation_of(const Suite& suite, const std::string& name) {
  return name == kCleanName ? Perturbation{} : find_named(suite.perturbations, "perturbation", name);
}
std::vector<std::string> controller_names_of(const Suite& suite) { return names_of(suite.controllers); }
std::vector<std::string> policy_names_of(const Suite& suite) { return names_of(suite.policies); }
std::vector<std::string> perturbation_names_of(const Suite& suite) { return names_of(suite.perturbations); }

std::string resolved_yaml(const Suite& suite) {
  std::vector<std::string_view> tasks;
  for (const Task task : suite.tasks) tasks.push_back(to_string(task));
  std::string text =
      fmt::format("schema: duet.suite/1\nname: {}\nversion: \"{}\"\nseed: {}\n", suite.name, suite.version, suite.seed);
  if (!suite.references.empty()) {
    text += fmt::format("{}engines: [{}]\n{}{}episodes_per_clip: {}\n{}", references_yaml(suite.references),
                        fmt::join(suite.engines, ", "), list_yaml("controllers", suite.controllers),
                        perturbations_yaml(suite), suite.episodes_per_clip, profile_yaml(suite.profile));
    if (!suite.robot.empty()) text += fmt::format("robot: \"{}\"\n", suite.robot);
    return text + fmt::format("limits: {{wall_s_per_episode: {}}}\nrecord: {{trajectories: {}}}\n", suite.wall_limit,
                              name_of(record_names(), suite.record));
  }
  if (suite.clips.files.empty()) {
    text += fmt::format("clips: {{synth: {{per_task: {}, seed: {}{}}}}}\n", suite.clips.synth_per_task,
                        suite.clips.synth_seed, variants_yaml(suite.clips.variants));
  } else {
    text += "clips:\n  files:\n";
    for (const std::string& file : suite.clips.files) text += fmt::format("    - \"{}\"\n", file);
  }
  text += fmt::format("tasks: [{}]\nengines: [{}]\n{}{}{}", fmt::join(tasks, ", "), fmt::join(suite.engines, ", "),
                      list_yaml("controllers", suite.controllers), list_yaml("policies", suite.policies),
                      perturbations_yaml(suite));
  text += fmt::format("episodes_per_clip: {}\nstart: {}\nstart_radius: {}\npartner: {}\nfuse_ticks: {}\n",
                      suite.episodes_per_clip, to_string(suite.start), suite.start_radius, to_string(suite.partner),
                      suite.fuse_ticks);
  text += profile_yaml(suite.profile);
  if (!suite.contact_limits.empty()) text += fmt::format("contact_limits: \"{}\"\n", suite.contact_limits);
  if (!suite.robot.empty()) text += fmt::format("robot: \"{}\"\n", suite.robot);
  text += fmt::format("detector: {{version: {}, thresholds: {}}}\n", to_string(suite.detector),
                      to_string(suite.thresholds));
  text += fmt::format("limits: {{wall_s_per_episode: {}}}\nrecord: {{trajectories: {}}}\nnull_arm: {}\n",
                      suite.wall_limit, name_of(record_names(), suite.record), suite.null_arm);
  const auto add_map = [&](const char* key, const std::map<std::string, std::string>& map) {
    if (map.empty()) return;
    text += fmt::format("{}:\n", key);
    for (const auto& [name, value] : map) text += fmt::format("  {}: {}\n", name, value);
  };
  add_map("retarget", suite.retarget);
  add_map("readings", suite.readings);
  return text;
}

}  // namespace duet
