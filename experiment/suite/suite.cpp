#include "duet/experiment/suite/suite.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/metrics/contact_limits.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/yaml_schema.h"

namespace duet {
std::size_t SuiteClips::copies() const {
  return std::max<std::size_t>(1, variants.size()) * (roles == ClipRoles::kBoth ? 2 : 1);
}

void vary(const ClipVariant& variant, SynthesisOptions& options) {
  options.side = variant.side;
  options.target_height = variant.target_height;
  if (variant.distance) options.distance = variant.distance;
  if (variant.outcome) options.outcome = variant.outcome;
  if (variant.still) options.still = variant.still;
}

Tags tags_of(const ClipVariant& variant) {
  Tags tags;
  if (variant.side) tags.emplace(kSideTag, name_of(side_names(), *variant.side));
  if (variant.target_height) tags.emplace(kHeightTag, fmt::format("{}", *variant.target_height));
  return tags;
}

const SuiteController& Suite::controller(const std::string& name) const {
  return entry_named(controllers, "controller", name);
}

SuitePolicy Suite::policy(const std::string& name) const {
  const bool control = name == kNullPolicy || std::ranges::find(controls, name) != controls.end();
  return control ? SuitePolicy{name} : entry_named(policies, "policy", name);
}

Perturbation Suite::perturbation(const std::string& name) const {
  return name == kCleanName ? Perturbation{} : entry_named(perturbations, "perturbation", name);
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

bool is_path_option(std::string_view option) {
  return option == "network" || option == "language" || option == "library";
}

const NameTable<SuiteStart>& start_names() {
  static const NameTable<SuiteStart> names = {{"auto", SuiteStart::kAuto},
                                              {"clip", SuiteStart::kClip},
                                              {"approach", SuiteStart::kApproach},
                                              {"act", SuiteStart::kAct},
                                              {"sim_to_real", SuiteStart::kSimToReal}};
  return names;
}

const NameTable<Side>& side_names() {
  static const NameTable<Side> names = {{"left", Side::kLeft}, {"right", Side::kRight}};
  return names;
}

const NameTable<ActOutcome>& act_outcome_names() {
  static const NameTable<ActOutcome> names = {
      {"complete", ActOutcome::kComplete}, {"hesitant", ActOutcome::kHesitant}, {"aborted", ActOutcome::kAborted}};
  return names;
}

const NameTable<ClipRoles>& role_names() {
  static const NameTable<ClipRoles> names = {{"own", ClipRoles::kOwn}, {"both", ClipRoles::kBoth}};
  return names;
}

const NameTable<Likeness>& likeness_names() {
  static const NameTable<Likeness> names = {
      {"rehearsed", Likeness::kScripted}, {"people", Likeness::kPeople}, {"varied", Likeness::kVaried}};
  return names;
}

const NameTable<SuitePartner>& partner_names() {
  static const NameTable<SuitePartner> names = {{"none", SuitePartner::kNone},
                                                {"ghost", SuitePartner::kGhost},
                                                {"solid", SuitePartner::kSolid},
                                                {"yielding", SuitePartner::kYielding}};
  return names;
}

const NameTable<RecordTrajectories>& record_names() {
  static const NameTable<RecordTrajectories> names = {{"none", RecordTrajectories::kNone},
                                                      {"failures", RecordTrajectories::kFailures},
                                                      {"all", RecordTrajectories::kAll}};
  return names;
}

const NameTable<DetectorVersion>& version_names() {
  static const NameTable<DetectorVersion> names = {{"robot", DetectorVersion::kRobot},
                                                   {"paper", DetectorVersion::kPaper},
                                                   {"interaction", DetectorVersion::kInteraction}};
  return names;
}

const NameTable<ThresholdSet>& threshold_names() {
  static const NameTable<ThresholdSet> names = {
      {"paper", ThresholdSet::kPaper}, {"strict", ThresholdSet::kStrict}, {"act", ThresholdSet::kAct}};
  return names;
}

std::string_view to_string(SuiteStart start) { return name_of(start_names(), start); }
std::string_view to_string(SuitePartner partner) { return name_of(partner_names(), partner); }

PartnerMode scene_mode(SuitePartner partner) {
  switch (partner) {
    case SuitePartner::kNone:
      return PartnerMode::kNone;
    case SuitePartner::kGhost:
      return PartnerMode::kGhost;
    default:
      return PartnerMode::kSolid;
  }
}

namespace {

constexpr const char* kCommand = "command";

// "stand", "forward_0.3", "left_0.15", "turn_right_0.3"; of a mixed command its three numbers.
std::string default_name(const Eigen::Vector3d& velocity) {
  constexpr const char* kNames[3][2] = {{"forward", "back"}, {"left", "right"}, {"turn_left", "turn_right"}};
  const auto moving = (velocity.array() != 0.0).count();
  if (moving == 0) return "stand";
  if (moving > 1) return fmt::format("{}_{}_{}", velocity.x(), velocity.y(), velocity.z());
  const int axis = velocity.x() != 0.0 ? 0 : velocity.y() != 0.0 ? 1 : 2;
  return fmt::format("{}_{}", kNames[axis][velocity[axis] < 0.0], std::abs(velocity[axis]));
}

const std::vector<std::string>& upper_bodies() {
  static const std::vector<std::string> names = {"still", "held", "moving"};  // in the order of UpperBody
  return names;
}

SuiteReference read_reference(const YAML::Node& node, const std::string& file) {
  const YamlSection item(
      file, node, "reference",
      {"name", "velocity", "seconds", "begin", "end", "pause", "upper_body", "perturbations", kTagsKey});
  SuiteReference reference;
  reference.velocity = item.vector3("velocity");
  if (reference.velocity.cwiseAbs().maxCoeff() > 10.0)
    item.fail_key("velocity", "expected at most 10 m/s and 10 rad/s");
  const auto time = [&](const char* key, double low, double high, double& out) {
    read_optional(item, {.name = key, .unit = "s", .range = {low, high}}, out);
  };
  time("seconds", 0.2, 600.0, reference.seconds);
  time("begin", 0.0, reference.seconds, reference.begin);
  reference.end = reference.seconds;
  time("end", reference.begin, reference.seconds, reference.end);
  time("pause", 0.0, 600.0, reference.pause);
  read_optional(item, {.name = "upper_body", .choices = upper_bodies()}, reference.upper_body);
  reference.tags = read_tags(item, kOfClip);
  for (const YAML::Node& node : item.items("perturbations")) {
    if (!node.IsScalar()) item.refuse_key("perturbations", "names of the suite's perturbations", node);
    reference.perturbations.push_back(node.Scalar());
  }
  reference.name = item.has("name") ? item.text("name") : default_name(reference.velocity);
  if (!is_plain_name(reference.name)) item.fail_key("name", plain_name_message(reference.name));
  return reference;
}

}  // namespace

std::vector<SuiteReference> read_references(const YamlSection& suite, const std::string& file) {
  if (!suite.has("reference")) return {};
  const YAML::Node node = suite.node("reference");
  if (node.IsMap()) return {read_reference(node, file)};
  std::vector<SuiteReference> list;
  for (const YAML::Node& item : suite.items("reference")) {
    list.push_back(read_reference(item, file));
    const auto same = [&](const SuiteReference& other) { return other.name == list.back().name; };
    if (std::count_if(list.begin(), list.end(), same) > 1)
      suite.fail(std::max(item.Mark().line, 0) + 1,
                 fmt::format("key 'reference': '{}' is there twice; names tell rows apart", list.back().name));
  }
  if (list.empty()) suite.fail_key("reference", "expected at least one, found none");
  return list;
}

std::string references_yaml(const std::vector<SuiteReference>& references) {
  std::string text;
  for (const SuiteReference& reference : references) {
    const Eigen::Vector3d& v = reference.velocity;
    text += fmt::format(
        "\n  - {{name: {}, velocity: [{}, {}, {}], seconds: {}, begin: {}, end: {}, pause: {}, upper_body: {}{}{}}}",
        reference.name, v.x(), v.y(), v.z(), reference.seconds, reference.begin, reference.end, reference.pause,
        upper_bodies().at(static_cast<std::size_t>(reference.upper_body)),
        reference.perturbations.empty()
            ? ""
            : fmt::format(", perturbations: [{}]", fmt::join(reference.perturbations, ", ")),
        tags_yaml(reference.tags));
  }
  return text;
}

const SuiteReference& reference_of(const std::vector<SuiteReference>& references, const std::string& name) {
  std::vector<std::string> known;
  for (const SuiteReference& reference : references) {
    if (reference.name == name) return reference;
    known.push_back(reference.name);
  }
  throw std::invalid_argument(unknown_name_message("reference", name, known));
}

StreamOptions stream_options(const SuiteReference& reference) {
  StreamOptions options;
  options.moves_upper_body = reference.upper_body == UpperBody::kMoving;
  options.holds_upper_body = reference.upper_body == UpperBody::kHeld;
  options.from_neutral = true;
  options.script = ScriptedCommand{
      .velocity = reference.velocity, .begin = reference.begin, .end = reference.end, .pause = reference.pause};
  return options;
}

bool takes_command(const ControllerInfo& controller) {
  return std::ranges::any_of(controller.options,
                             [](const ControllerOption& option) { return option.name == kCommand; });
}

ControllerOptions with_command(const ControllerInfo& controller, ControllerOptions options,
                               const SuiteReference& reference) {
  const Eigen::Vector3d& v = reference.velocity;
  if (takes_command(controller)) options.try_emplace(kCommand, fmt::format("{},{},{}", v.x(), v.y(), v.z()));
  return options;
}

}  // namespace duet
