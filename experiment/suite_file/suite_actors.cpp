#include "duet/experiment/suite_file/suite_actors.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <utility>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/suite_file/suite_key.h"
#include "duet/policies/averaged_partner.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/hand_servo.h"
#include "duet/robots/yaml_section.h"

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
  if (!node.IsMap()) item.refuse_key("options", "a mapping", node);
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
    item.fail_key("partner", fmt::format("expected 'own' or 'shuffled', found '{}'", partner));
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
      top.fail(std::max(node.Mark().line, 0) + 1, fmt::format("key '{}': {}", key, error.what()));
    }
  }
  if (items.empty()) top.fail_key(key, fmt::format("expected at least one {}, found none", kind));
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
  check_options("policy", policy.name, policy.options, names_of(info.options));
  for (const auto& [option, word] : {std::pair{kHandServo, "servo"}, std::pair{kAverage, "average"}}) {
    const auto given = policy.options.find(option);
    require(given == policy.options.end() || given->second == "false" || policy.name.find(word) != std::string::npos,
            "policy '{}': {} is on: expected a name that says `{}` ('{}+{}'), so that no table takes it for the policy "
            "without",
            policy.name, option, word, policy.name, word);
  }
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

namespace {

constexpr const char* kGiven = "given";  // in the place of files: by who runs the suite

const FieldTable<ClipVariant>& variant_fields() {
  static const FieldTable<ClipVariant> table = {
      field<ClipVariant>({.name = "name", .meaning = "follows the clip's id"}, &ClipVariant::name),
      field<ClipVariant>({.name = "side", .choices = choices_of(side_names())}, &ClipVariant::side),
      field<ClipVariant>({.name = "target_height", .unit = "m"}, &ClipVariant::target_height),
      field<ClipVariant>({.name = "distance", .unit = "m"}, &ClipVariant::distance),
      field<ClipVariant>({.name = "outcome", .choices = choices_of(act_outcome_names())}, &ClipVariant::outcome),
      field<ClipVariant>({.name = "still",
                          .meaning = "varied, of a gesture: whether the partner stands still",
                          .choices = flag_words()},
                         &ClipVariant::still)};
  return table;
}

ClipVariant read_variant(const YAML::Node& node, const std::string& file) {
  const YamlSection item(file, node, "variant", key_names(variant_fields()));
  ClipVariant variant;
  static_cast<void>(item.text("name"));  // it has to be there
  read_fields(item, variant_fields(), variant);
  if (!is_plain_name(variant.name)) item.fail_key("name", plain_name_message(variant.name));
  if (!variant.side && !variant.target_height && !variant.distance && !variant.outcome && !variant.still)
    item.fail(item.line(), "expected side, target_height, distance, outcome or still, found none");
  return variant;
}

void read_variants(const YamlSection& synth, Suite& suite) {
  for (const YAML::Node& node : synth.items("variants")) {
    suite.clips.variants.push_back(read_variant(node, suite.file));
    const std::string& name = suite.clips.variants.back().name;
    const auto same = [&](const ClipVariant& other) { return other.name == name; };
    if (std::count_if(suite.clips.variants.begin(), suite.clips.variants.end(), same) > 1)
      synth.fail_key("variants", fmt::format("'{}' is there twice; names tell clips apart", name));
  }
}

// The key `files`: paths, or the word `given`.
void read_files(const YamlSection& clips, Suite& suite) {
  if (!clips.has("files")) return;
  suite.clips.given = clips.node("files").IsScalar() && clips.node("files").Scalar() == kGiven;
  if (!suite.clips.given) suite.clips.files = names_in(clips, "files");
}

// Paths from the suite's folder; a folder is the clips in it. That a file is there is asked when it is read.
void use_clip_files(const YamlSection& clips, Suite& suite) {
  std::vector<std::string> files;
  for (const std::string& file : suite.clips.files) {
    const std::string path = from_folder_of(suite, file);
    try {
      const bool folder = std::filesystem::is_directory(path);
      for (std::string& found : folder ? find_clip_files({path}) : std::vector{path}) files.push_back(std::move(found));
    } catch (const InputError& error) {
      clips.fail_key("files", error.what());
    }
  }
  suite.clips.files = std::move(files);
}

// Checks the keys below `clips` against each other.
void check_clips(const YamlSection& clips, const YamlSection& synth, const SuiteClips& read) {
  const bool synthetic = read.synth_per_task > 0, from_files = read.given || !read.files.empty();
  if (synthetic == from_files)
    clips.fail(clips.line(),
               fmt::format("clips: expected either synth.per_task or files, found {}", synthetic ? "both" : "neither"));
  if (!from_files && read.synth_per_file > 0)
    clips.fail(synth.line("per_file"), "per_file: expected files, for each of which so many clips are synthesised");
  if (!synthetic && !read.variants.empty())
    clips.fail(synth.line("variants"), "variants: expected per_task, as only synthesised clips have variants");
}

std::string variants_yaml(const std::vector<ClipVariant>& variants) {
  if (variants.empty()) return "";
  std::vector<std::string> texts;
  texts.reserve(variants.size());
  for (const ClipVariant& variant : variants) texts.push_back(flow_mapping(variant_fields(), variant));
  return fmt::format(", variants: [{}]", fmt::join(texts, ", "));
}

}  // namespace

const FieldTable<SuiteClips>& synth_fields() {
  static const FieldTable<SuiteClips> table = {
      field<SuiteClips>({.name = "per_task", .meaning = "clips to synthesise for each task", .range = {.low = 1}},
                        &SuiteClips::synth_per_task),
      field<SuiteClips>({.name = "per_file",
                         .meaning = "beside `files`: of each task so many synthesised clips for each of its files, "
                                    "cropped to the act and padded as these are",
                         .range = {.low = 0}},
                        &SuiteClips::synth_per_file),
      field<SuiteClips>({.name = "seed", .meaning = "of what is synthesised"}, &SuiteClips::synth_seed),
      field<SuiteClips>({.name = "like",
                         .meaning = "which generator: acts rehearsed on a stage, or people as they were recorded",
                         .choices = choices_of(likeness_names())},
                        &SuiteClips::synth_like),
      field<SuiteClips>(
          {.name = "tracked", .meaning = "as a depth camera would have them: 15 Hz, centimetres of noise, arms lost"},
          &SuiteClips::synth_tracked)};
  return table;
}

const FieldTable<ClipPadding>& padding_fields() {
  constexpr FieldRange kPadding = {0.0, 60.0};
  static const FieldTable<ClipPadding> table = {
      field<ClipPadding>({.name = "before",
                          .meaning = "both people stand as in their first frame for so long before each clip: for "
                                     "recordings that were cropped to the act. Clips of two people only",
                          .unit = "s",
                          .range = kPadding},
                         &ClipPadding::before),
      field<ClipPadding>({.name = "after", .meaning = "and after it", .unit = "s", .range = kPadding},
                         &ClipPadding::after)};
  return table;
}

const Field<SuiteClips>& roles_field() {
  static const Field<SuiteClips> roles = field<SuiteClips>(
      {.name = "roles",
       .meaning = "whom the robot replaces: whom the clip says, or both people in turn (the id of the "
                  "other one ends in `-A` or `-B`). Clips of two people only",
       .choices = choices_of(role_names())},
      &SuiteClips::roles);
  return roles;
}

void read_clips(const YamlSection& top, Suite& suite) {
  const YamlSection clips = section_below(top, suite.file, "clips", {"synth", "files", "pad", "roles"});
  std::vector<const char*> synth_keys = key_names(synth_fields());
  synth_keys.push_back("variants");
  const YamlSection synth = section_below(clips, suite.file, "synth", synth_keys);
  read_fields(synth, synth_fields(), suite.clips);
  read_variants(synth, suite);
  read_files(clips, suite);
  read_fields(section_below(clips, suite.file, "pad", key_names(padding_fields())), padding_fields(), suite.clips.pad);
  read_field(clips, roles_field(), suite.clips);
  check_clips(clips, synth, suite.clips);
  use_clip_files(clips, suite);
}

// Refuses here what a variant asks of a task that cannot give it, not when its clips are made.
void check_variants(const YamlSection& top, const Suite& suite) {
  checked(top, "clips", [&] {
    for (const ClipVariant& variant : suite.clips.variants) {
      for (const Task task : suite.tasks) {
        SynthesisOptions options;
        options.like = suite.clips.synth_like;
        vary(variant, options);
        check_synthesis_options(task, options);
      }
    }
  });
}

namespace {

// The first generator, no tracker and nothing for files go without saying, as in every suite before there were others.
std::string synth_yaml(const SuiteClips& clips) {
  std::string text = clips.synth_per_task > 0 ? fmt::format("{{per_task: {}", clips.synth_per_task)
                                              : fmt::format("{{per_file: {}", clips.synth_per_file);
  text += fmt::format(", seed: {}", clips.synth_seed);
  if (clips.synth_like != Likeness::kScripted)
    text += fmt::format(", like: {}", name_of(likeness_names(), clips.synth_like));
  if (clips.synth_tracked) text += ", tracked: true";
  return text + variants_yaml(clips.variants) + "}";
}

std::vector<std::string> files_yaml(const SuiteClips& clips) {
  if (clips.given) return {fmt::format("files: {}", kGiven)};
  if (clips.files.empty()) return {};
  std::string text = "files:\n";
  for (const std::string& file : clips.files)
    text += fmt::format("    - \"{}\"{}", file, &file == &clips.files.back() ? "" : "\n");
  return {text};
}

}  // namespace

// A padding that is none and roles that are the clips' own are not written: suites of before keep their hash.
std::string clips_yaml(const SuiteClips& clips) {
  std::vector<std::string> parts = files_yaml(clips);
  if (clips.synth_per_task > 0 || clips.synth_per_file > 0) parts.push_back("synth: " + synth_yaml(clips));
  if (clips.pad.any()) parts.push_back("pad: " + flow_mapping(padding_fields(), clips.pad));
  if (clips.roles != ClipRoles::kOwn) parts.push_back(fmt::format("roles: {}", name_of(role_names(), clips.roles)));
  if (clips.files.empty()) return fmt::format("{{{}}}", fmt::join(parts, ", "));
  return fmt::format("\n  {}", fmt::join(parts, "\n  "));
}

}  // namespace duet
