#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>

#include "duet/backends/actuation.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/robots/yaml_section.h"
#include "duet/rollout/perturbations/perturbation.h"
#include "duet/rollout/perturbations/perturbation_kind.h"

namespace duet {
namespace {

using Kinds = std::vector<PerturbationKind>;

Field<Perturbation> milliseconds(double high, double Perturbation::*member) {
  return field<Perturbation>({.name = "ms", .meaning = "how much later", .unit = "ms", .range = {0.0, high, false}},
                             member);
}

const FieldTable<PerceptionFreeze>& freeze_fields() {
  static const FieldTable<PerceptionFreeze> table = {
      field<PerceptionFreeze>({.name = "at", .meaning = "when", .unit = "s", .range = kEpisodeTime},
                              &PerceptionFreeze::at),
      field<PerceptionFreeze>({.name = "for", .meaning = "how long", .unit = "s", .range = {0.0, 600.0, false}},
                              &PerceptionFreeze::duration)};
  return table;
}

const FieldTable<PerceptionJump>& jump_fields() {
  static const FieldTable<PerceptionJump> table = {
      field<PerceptionJump>({.name = "at", .meaning = "when", .unit = "s", .range = kEpisodeTime}, &PerceptionJump::at),
      field<PerceptionJump>({.name = "metres",
                             .meaning = "how far, level, in a direction drawn for the episode",
                             .unit = "m",
                             .range = {0.0, 10.0, false}},
                            &PerceptionJump::metres)};
  return table;
}

const FieldTable<PartnerVariation>& partner_fields() {
  using V = PartnerVariation;
  static const FieldTable<V> table = {
      field<V>({.name = "scale",
                .meaning = "of its body about the place on the ground below its root; the way it walks stays",
                .range = {0.5, 1.5}},
               &V::scale),
      field<V>({.name = "speed", .meaning = "of its motion from the episode's start on", .range = {0.25, 4.0}},
               &V::speed),
      field<V>(
          {.name = "shift_s",
           .meaning = "above 0 it waits so long; below 0 it starts so far into its preparation, at most at the act",
           .unit = "s",
           .range = {-30.0, 30.0}},
          &V::shift_s),
      field<V>({.name = "hesitate_s",
                .meaning = "it stands still so long at half of its preparation",
                .unit = "s",
                .range = {0.0, 30.0}},
               &V::hesitate_s),
      field<V>({.name = "abort",
                .meaning = "at the middle of the act it goes back along its own path and stays where it began"},
               &V::abort),
      field<V>({.name = "comes_m",
                .meaning = "it begins so far behind its place and walks up in the first half of its preparation",
                .unit = "m",
                .range = {0.0, 5.0}},
               &V::comes_m),
      field<V>(
          {.name = "moves_on_m",
           .meaning = "in the second half of its preparation it goes so far back (below 0: forward) and stays there",
           .unit = "m",
           .range = {-1.0, 2.0}},
          &V::moves_on_m),
      field<V>({.name = "aside_m",
                .meaning = "and so far to its left (below 0: to its right)",
                .unit = "m",
                .range = {-2.0, 2.0}},
               &V::aside_m),
      field<V>({.name = "other_hand",
                .meaning = "it does with the left what the clip's person does with the right",
                .choices = {"false", "true"}},
               &V::other_hand)};
  return table;
}

// Adds the kinds that the controller and the robot meet.
void add_body_kinds(Kinds& list) {
  using P = Perturbation;
  list.push_back(valued_kind("delay", "the controller sees the state of so many control ticks (20 ms) ago",
                             field<P>({.name = "ticks", .meaning = "how many", .range = {1, 50}}, &P::delay_ticks),
                             "2"));
  list.push_back(valued_kind("latency", "a command takes effect so much later, to the nearest physics step",
                             milliseconds(500.0, &P::latency_ms), "20"));
  list.push_back(noise_kind());
  list.push_back(push_kind());
  list.push_back(kick_kind());
  list.push_back(plain_kind(
      field<P>({.name = "friction", .meaning = "of the robot and the ground, otherwise 0.8", .range = {0.0, 10.0}},
               &P::friction),
      "0.4"));
  list.push_back(mass_kind());
  list.push_back(planned_kind("actuation", "the joints are driven otherwise; what is not named is the profile's",
                              actuation_fields<ActuationChange>(), [](auto& p) -> auto& { return p.actuation; },
                              {.law = std::nullopt, .armature = std::nullopt, .dt = std::nullopt}));
}

// Adds the kinds that change how the policy sees its partner; physics, detectors and recording have the real one.
void add_perception_kinds(Kinds& list) {
  using P = Perturbation;
  list.push_back(valued_kind("jitter", "the partner's joints are seen with noise, drawn anew every tick",
                             field<P>(
                                 {.name = "sigma",
                                  .meaning = "standard deviation on each axis of each joint",
                                  .unit = "m",
                                  .range = {0.0, 1.0, false}},
                                 [](auto& p) -> auto& { return p.perception.jitter; }),
                             "0.02"));
  list.push_back(valued_kind("dropout", "a joint of the partner is not seen at a tick and keeps its last seen place",
                             field<P>(
                                 {.name = "p", .meaning = "probability per joint and tick", .range = {0.0, 1.0, false}},
                                 [](auto& p) -> auto& { return p.perception.dropout; }),
                             "0.1"));
  list.push_back(valued_kind("perception_latency",
                             "the partner is seen as so long ago, to the nearest tick; at first as at the start",
                             field<P>(
                                 {.name = "ms", .meaning = "how long ago", .unit = "ms", .range = {0.0, 5000.0, false}},
                                 [](auto& p) -> auto& { return p.perception.latency_ms; }),
                             "200"));
  list.push_back(valued_kind("vanish", "the partner is not seen from then on: the last seen pose stays",
                             field<P>(
                                 {.name = "at", .meaning = "when", .unit = "s", .range = kEpisodeTime},
                                 [](auto& p) -> auto& { return p.perception.vanish; }),
                             "2"));
  list.push_back(planned_kind(
      "freeze", "the partner is seen as at that time for so long", freeze_fields(),
      [](auto& p) -> auto& { return p.perception.freeze; }));
  list.push_back(planned_kind(
      "jump", "the partner is seen so far from its place from then on", jump_fields(),
      [](auto& p) -> auto& { return p.perception.jump; }));
}

// The values that are 0 in a clean episode, with the unit that tables give them and how many of it one is.
struct KindAxis {
  std::string_view kind;
  PerturbationAxis axis;
};
const std::vector<KindAxis>& kind_axes() {
  static const std::vector<KindAxis> axes = {
      {"delay", {"ticks", "ticks"}},    {"latency", {"ms", "s", 1e-3}},   {"noise", {"q", "rad"}},
      {"noise", {"v", "rad/s"}},        {"noise", {"w", "rad/s"}},        {"noise", {"gravity", "rad"}},
      {"push", {"force", "N"}},         {"kick", {"speed", "m/s"}},       {"mass", {"add", "kg"}},
      {"jitter", {"sigma", "m"}},       {"dropout", {"p", ""}},           {"perception_latency", {"ms", "s", 1e-3}},
      {"freeze", {"for", "s"}},         {"jump", {"metres", "m"}},        {"plan_latency", {"ms", "s", 1e-3}},
      {"partner", {"shift_s", "s"}},    {"partner", {"hesitate_s", "s"}}, {"partner", {"comes_m", "m"}},
      {"partner", {"moves_on_m", "m"}}, {"partner", {"aside_m", "m"}}};
  return axes;
}

Kinds make_kinds() {
  Kinds list;
  list.reserve(16);
  add_body_kinds(list);
  add_perception_kinds(list);
  list.push_back(valued_kind(
      "plan_latency", "a policy's plan arrives so much later, to the nearest tick; until then the plan before holds",
      milliseconds(2000.0, &Perturbation::plan_latency_ms), "100"));
  list.push_back(planned_kind(
      "partner", "the partner moves otherwise than in the clip", partner_fields(),
      [](auto& p) -> auto& { return p.partner; }));
  for (PerturbationKind& kind : list)
    for (const KindAxis& known : kind_axes())
      if (known.kind == kind.name) kind.axes.push_back(known.axis);
  return list;
}

}  // namespace

const Kinds& perturbation_kind_table() {
  static const Kinds table = make_kinds();
  return table;
}

namespace {

// Whether a value is what it is in a clean episode.
bool is_default(const PerturbationKind& kind, const std::string& name, const std::string& text) {
  const auto row = std::ranges::find(kind.rows, name, &FieldRow::name);
  return row != kind.rows.end() && row->fallback == text;
}

// In a kind with several such values one alone may differ from a clean episode, and no other value.
std::optional<PerturbationSize> size_in(const PerturbationKind& kind, const Perturbation& of) {
  const bool several = kind.axes.size() > 1;
  std::optional<PerturbationSize> size;
  std::vector<std::string> beside;
  for (const auto& [name, text] : kind.values ? kind.values(of) : FieldTexts()) {
    const auto axis = std::ranges::find(kind.axes, name, &PerturbationAxis::field);
    if (axis == kind.axes.end()) {
      if (several && !is_default(kind, name, text)) return std::nullopt;
      if (!several) beside.push_back(fmt::format("{}: {}", name, text));
      continue;
    }
    const double value = parse_number(text).value_or(0.0);
    if (value == 0.0) continue;
    if (size) return std::nullopt;
    size = {.family = several ? fmt::format("{}.{}", kind.name, name) : kind.name,
            .x = value * axis->factor,
            .unit = axis->unit,
            .beside = {}};
  }
  if (size) size->beside = fmt::format("{}", fmt::join(beside, ", "));
  return size;
}

std::vector<const PerturbationKind*> kinds_in(const Perturbation& perturbation) {
  std::vector<const PerturbationKind*> kinds;
  for (const PerturbationKind& known : perturbation_kind_table())
    if (!known.write(perturbation).empty()) kinds.push_back(&known);
  return kinds;
}

}  // namespace

std::optional<PerturbationSize> size_of(const Perturbation& perturbation) {
  const std::vector<const PerturbationKind*> kinds = kinds_in(perturbation);
  return kinds.size() == 1 ? size_in(*kinds.front(), perturbation) : std::nullopt;
}

Tags tags_of(const Perturbation& perturbation) {
  Tags tags;
  for (const auto& [name, value] : perturbation.tags) tags.emplace(row_tag(kOfPerturbation, name), value);
  std::string kinds;
  for (const PerturbationKind* kind : kinds_in(perturbation)) kinds += (kinds.empty() ? "" : "+") + kind->name;
  if (kinds.empty()) return tags;
  tags.emplace(kKindsTag, kinds);
  const std::optional<PerturbationSize> size = size_of(perturbation);
  if (!size) return tags;
  tags.emplace(kFamilyTag, size->family);
  tags.emplace(kSizeTag, fmt::format("{}", size->x));
  tags.emplace(kUnitTag, size->unit);
  tags.emplace(kBesideTag, size->beside);
  return tags;
}

// Reads, writes and lists perturbations by the table of their kinds.

namespace {

std::vector<std::string> kinds_of(const YamlSection& item) {
  std::vector<std::string> names;
  for (const PerturbationKind& known : perturbation_kind_table())
    if (item.has(known.name.c_str())) names.push_back(known.name);
  return names;
}

Perturbation read_kinds(const SchemaSection& item) {
  Perturbation perturbation;
  for (const PerturbationKind& known : perturbation_kind_table())
    if (item.has(known.name.c_str())) known.read(item, perturbation);
  return perturbation;
}

std::vector<const char*> keys_of_item() {
  std::vector<const char*> keys = {"name", kTagsKey};
  for (const PerturbationKind& known : perturbation_kind_table()) keys.push_back(known.name.c_str());
  return keys;
}

Perturbation read_item(const YamlSection& suite, const YAML::Node& node, const std::string& file) {
  const int line = std::max(node.Mark().line, 0) + 1;
  if (node.IsScalar()) {
    try {
      return default_perturbation(node.Scalar());
    } catch (const std::invalid_argument& error) {
      suite.fail(line, fmt::format("key 'perturbations': {}", error.what()));
    }
  }
  const SchemaSection item(file, node, "perturbation", keys_of_item());
  const std::vector<std::string> named = kinds_of(item);
  if (named.empty())
    item.fail(line, fmt::format("expected at least one of {}, found none", fmt::join(perturbation_kinds(), ", ")));
  Perturbation perturbation = read_kinds(item);
  perturbation.tags = read_tags(item, kOfPerturbation);
  perturbation.name = item.has("name") ? item.text("name") : fmt::format("{}", fmt::join(named, "+"));
  if (perturbation.name == kCleanName) item.fail_key("name", "'clean' is the arm without a perturbation");
  if (!is_plain_name(perturbation.name)) item.fail_key("name", plain_name_message(perturbation.name));
  return perturbation;
}

}  // namespace

const std::vector<std::string>& perturbation_kinds() {
  static const std::vector<std::string> names = names_of(perturbation_kind_table());
  return names;
}

Perturbation default_perturbation(const std::string& kind) {
  if (kind == kCleanName) return {};
  for (const PerturbationKind& known : perturbation_kind_table()) {
    if (known.name != kind) continue;
    const YAML::Node item = YAML::Load(fmt::format("{{{}: {}}}", kind, known.fallback));
    Perturbation perturbation = read_kinds({kind, item, "perturbation", {known.name.c_str()}});
    perturbation.name = kind;
    return perturbation;
  }
  std::vector<std::string> names = perturbation_kinds();
  names.insert(names.begin(), kCleanName);
  throw std::invalid_argument(unknown_name_message("perturbation", kind, names));
}

std::vector<Perturbation> read_perturbations(const YamlSection& suite, const std::string& file) {
  if (!suite.has("perturbations")) return {Perturbation{}};
  std::vector<Perturbation> list;
  for (const YAML::Node& node : suite.items("perturbations")) {
    list.push_back(read_item(suite, node, file));
    const auto same = [&](const Perturbation& other) { return other.name == list.back().name; };
    if (std::count_if(list.begin(), list.end(), same) > 1)
      suite.fail(std::max(node.Mark().line, 0) + 1,
                 fmt::format("key 'perturbations': '{}' is there twice; names tell rows apart", list.back().name));
  }
  if (list.empty()) suite.fail_key("perturbations", "expected at least one, found none");
  return list;
}

std::string to_yaml(const Perturbation& perturbation) {
  std::vector<std::string> parts = {fmt::format("name: {}", perturbation.name)};
  for (const PerturbationKind& known : perturbation_kind_table())
    if (const std::string value = known.write(perturbation); !value.empty())
      parts.push_back(fmt::format("{}: {}", known.name, value));
  return parts.size() == 1 ? perturbation.name
                           : fmt::format("{{{}{}}}", fmt::join(parts, ", "), tags_yaml(perturbation.tags));
}

}  // namespace duet
