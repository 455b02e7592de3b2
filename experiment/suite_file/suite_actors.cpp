#include "duet/experiment/suite_file/suite_actors.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/names.h"
#include "duet/core/plain_name.h"
#include "duet/core/require.h"
#include "duet/experiment/suite/suite_names.h"
#include "duet/experiment/suite_file/suite_section.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/robots/yaml_tags.h"

namespace duet {
namespace {

using Options = std::map<std::string, std::string>;

constexpr const char* kDescriptor = ".yaml";

// A network may also be one that ships, by its name ("oracle").
std::string file_or_name(const Suite& suite, const std::string& value) {
  const std::string path = from_folder_of(suite, value);
  const bool name = value.find_first_of("./") == std::string::npos;
  return name && !std::filesystem::exists(path) ? value : path;
}

// Values as written, but paths from the suite's folder.
Options read_options(const YamlSection& item, const Suite& suite) {
  Options options;
  if (!item.has("options")) return options;
  const YAML::Node node = item.node("options");
  if (!node.IsMap())
    item.fail(item.line("options"), fmt::format("options: expected a mapping, found {}", describe(node)));
  for (const auto& entry : node) {
    const auto name = entry.first.as<std::string>();
    if (!entry.second.IsScalar())
      item.fail(entry.first.Mark().line + 1,
                fmt::format("options.{}: expected one value, found {}", name, describe(entry.second)));
    options[name] = is_path_option(name) ? file_or_name(suite, entry.second.Scalar()) : entry.second.Scalar();
  }
  return options;
}

std::string name_in_descriptor(const SuiteController& controller) { return controller_info(controller.use).name; }
std::string name_in_descriptor(const SuitePolicy& policy) { return policy_info(policy.use).name; }

// Names a controller or a policy: by a name, a descriptor's path, or a mapping with name, use and options. Where the
// suite gives no name of its own, that of the descriptor holds.
template <typename Actor>
void finish_names(const Suite& suite, Actor& actor) {
  if (actor.use.ends_with(kDescriptor)) actor.use = from_folder_of(suite, actor.use);
  if (actor.name.ends_with(kDescriptor)) {
    actor.name = name_in_descriptor(actor);
    require(is_plain_name(actor.name), "{}: name: {}", actor.use, plain_name_message(actor.name));
  }
  require(is_plain_name(actor.name), plain_name_message(actor.name));
}

SuiteController read_controller(const YAML::Node& node, const Suite& suite) {
  SuiteController controller;
  if (node.IsScalar()) {
    controller.name = controller.use = node.Scalar();
  } else {
    const YamlSection item(suite.file, node, "controller", {"name", "use", "options"});
    controller.name = item.text("name");
    controller.use = item.has("use") ? item.text("use") : controller.name;
    controller.options = read_options(item, suite);
  }
  finish_names(suite, controller);
  controller.about = controller_info(controller.use);
  return controller;
}

bool reads_shuffled(const YamlSection& item) {
  if (!item.has("partner")) return false;
  const std::string partner = item.text("partner");
  if (partner != "own" && partner != "shuffled")
    item.fail(item.line("partner"), fmt::format("partner: expected 'own' or 'shuffled', found '{}'", partner));
  return partner == "shuffled";
}

SuitePolicy read_policy(const YAML::Node& node, const Suite& suite) {
  SuitePolicy policy;
  if (node.IsNull()) {  // the word null without quotes, which YAML takes for nothing
    policy.name = policy.use = kNullPolicy;
  } else if (node.IsScalar()) {
    policy.name = policy.use = node.Scalar();
  } else {
    const YamlSection item(suite.file, node, "policy",
                           {"name", "use", "options", "network", "prompt", "partner", kTagsKey});
    policy.name = item.text("name");
    policy.use = item.has("use") ? item.text("use") : policy.name;
    policy.options = read_options(item, suite);
    if (item.has("network")) {
      require(!policy.options.contains("network"), "expected the network once, found it in options too");
      policy.options["network"] = file_or_name(suite, item.text("network"));
    }
    if (item.has("prompt")) policy.prompt = item.text("prompt");
    policy.shuffled_partner = reads_shuffled(item);
    policy.tags = read_tags(item, kOfPolicy);
  }
  finish_names(suite, policy);
  return policy;
}

template <typename Actor>
void require_new_name(const std::vector<Actor>& actors, const std::string& name) {
  require(std::none_of(actors.begin(), actors.end(), [&](const Actor& other) { return other.name == name; }),
          "'{}' is there twice; names tell rows apart ({{name: ..., use: ...}} gives another)", name);
}

// Runs `add` on each item of a list that must not be empty; a std::invalid_argument becomes file and line.
void read_list(const YamlSection& top, const char* key, const char* kind,
               const std::function<void(const YAML::Node&)>& add) {
  const std::vector<YAML::Node> items = top.items(key);
  for (const YAML::Node& node : items) {
    try {
      add(node);
    } catch (const std::invalid_argument& error) {
      top.fail(std::max(node.Mark().line, 0) + 1, fmt::format("{}: {}", key, error.what()));
    }
  }
  if (items.empty())
    top.fail(top.has(key) ? top.line(key) : top.line(),
             fmt::format("{}: expected at least one {}, found none", key, kind));
}

std::string options_yaml(const std::map<std::string, std::string>& options) {
  std::vector<std::string> texts;
  texts.reserve(options.size());
  for (const auto& [name, value] : options) texts.push_back(fmt::format("{}: {}", name, yaml_quoted(value)));
  return fmt::format(", options: {{{}}}", fmt::join(texts, ", "));
}

// A plain controller or policy is its name.
std::string to_yaml(const SuiteController& controller) {
  if (controller.use == controller.name && controller.options.empty()) return controller.name;
  return fmt::format("{{name: {}, use: {}{}}}", controller.name, yaml_quoted(controller.use),
                     controller.options.empty() ? "" : options_yaml(controller.options));
}

std::string to_yaml(const SuitePolicy& policy) {
  const bool plain = policy.options.empty() && policy.prompt.empty() && !policy.shuffled_partner && policy.tags.empty();
  if (policy.use == policy.name && plain) return policy.name;
  return fmt::format("{{name: {}, use: {}{}{}{}{}}}", policy.name, yaml_quoted(policy.use),
                     policy.options.empty() ? "" : options_yaml(policy.options),
                     policy.prompt.empty() ? "" : ", prompt: " + yaml_quoted(policy.prompt),
                     policy.shuffled_partner ? ", partner: shuffled" : "", tags_yaml(policy.tags));
}

template <typename Item>
std::string list_yaml(const std::vector<Item>& items) {
  std::vector<std::string> texts;
  texts.reserve(items.size());
  for (const Item& item : items) texts.push_back(to_yaml(item));
  return fmt::format("[{}]", fmt::join(texts, ", "));
}

}  // namespace

ControllerInfo about(const SuiteController& controller) {
  return controller.about ? *controller.about : controller_info(controller.use);
}

void check_options_of(const SuiteController& controller) {
  ControllerInfo info = about(controller);
  info.name = controller.name;
  check_controller_options(info, controller.options);
}

void check_options_of(const SuitePolicy& policy) {
  const PolicyInfo info = policy_info(policy.use);
  require(policy.name != kNullPolicy || policy.options.empty(), "policy 'null': expected no option of the control arm");
  std::vector<std::string> known;
  for (const PolicyOption& option : info.options) known.push_back(option.name);
  check_options("policy", policy.name, policy.options, known);
}

void set_controller_option(Suite& suite, const std::string& controller, const std::string& option,
                           const std::string& value) {
  SuiteController asked = suite.controller(controller);
  asked.options = {{option, value}};
  check_options_of(asked);
  for (SuiteController& entry : suite.controllers)
    if (entry.name == controller) entry.options[option] = value;
}

void set_policy_option(Suite& suite, const std::string& policy, const std::string& option, const std::string& value) {
  SuitePolicy asked = suite.policy(policy);
  asked.options = {{option, value}};
  check_options_of(asked);
  for (SuitePolicy& entry : suite.policies)
    if (entry.name == policy) entry.options[option] = value;
}

std::string from_folder_of(const Suite& suite, const std::string& file) {
  const std::filesystem::path beside = std::filesystem::path(suite.file).parent_path() / file;
  const bool here = !std::filesystem::exists(beside) && std::filesystem::exists(file);
  return std::filesystem::absolute(here ? std::filesystem::path(file) : beside).lexically_normal().string();
}

std::string controllers_yaml(const Suite& suite) { return list_yaml(suite.controllers); }
std::string policies_yaml(const Suite& suite) { return list_yaml(suite.policies); }

void read_controllers(const YamlSection& top, Suite& suite) {
  read_list(top, "controllers", "controller", [&](const YAML::Node& node) {
    SuiteController controller = read_controller(node, suite);
    require_new_name(suite.controllers, controller.name);
    check_options_of(controller);
    suite.controllers.push_back(std::move(controller));
  });
}

void read_policies(const YamlSection& top, Suite& suite) {
  read_list(top, "policies", "policy", [&](const YAML::Node& node) {
    SuitePolicy policy = read_policy(node, suite);
    require_new_name(suite.policies, policy.name);
    require(policy.name != kNullPolicy || policy.use == kNullPolicy, "'null' is the name of the control arm");
    check_options_of(policy);
    suite.policies.push_back(std::move(policy));
  });
}

}  // namespace duet
