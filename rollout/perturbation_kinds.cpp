#include "duet/rollout/perturbation_kinds.h"

#include <utility>

#include "duet/robots/yaml_fields.h"

namespace duet {
namespace {

using Kinds = std::vector<PerturbationKind>;

constexpr FieldRange kEpisodeTime = {0.0, 600.0};  // [s]

// A kind whose values are a struct of its own: `slot` is the optional one of a perturbation. `named` is what the values
// are where the mapping names some of them.
template <typename Plan, typename Slot>
PerturbationKind planned(std::string name, std::string meaning, FieldTable<Plan> table, Slot slot, Plan named = {}) {
  PerturbationKind kind{name, std::move(meaning), field_rows(table, Plan()), {}, {}};
  kind.read = [name, table, slot, named](const YamlSection& item, const std::string& file, Perturbation& into) {
    const YamlSection mapping(file, item.node(name.c_str()), name, field_keys(table));
    Plan plan = mapping.keys().size() > 0 ? named : Plan();
    read_fields(mapping, table, plan);
    slot(into) = plan;
  };
  kind.write = [table, slot](const Perturbation& of) { return slot(of) ? flow_mapping(table, *slot(of)) : ""; };
  return kind;
}

// A kind of one value, under a key of its mapping: what the perturbation has of it where it is not clean, `fallback`
// where the mapping is empty.
PerturbationKind valued(const std::string& name, std::string meaning, const Field<Perturbation>& value,
                        const std::string& fallback) {
  PerturbationKind kind{name, std::move(meaning), {{value.name, value.values, fallback, value.meaning}}, {}, {}};
  kind.read = [name, value, fallback](const YamlSection& item, const std::string& file, Perturbation& into) {
    const YamlSection mapping(file, item.node(name.c_str()), name, {value.name.c_str()});
    set_field(value, into, fallback);
    read_field(mapping, value, into);
  };
  kind.write = [value](const Perturbation& of) {
    const std::string text = value.text(of);
    return text == value.text(Perturbation()) ? "" : '{' + value.name + ": " + text + '}';
  };
  return kind;
}

// A kind that is a value itself, without a mapping.
PerturbationKind plain(const Field<Perturbation>& value, const std::string& fallback) {
  PerturbationKind kind{value.name, value.meaning, {{"", value.values, fallback, ""}}, {}, value.text, fallback};
  kind.read = [value](const YamlSection& item, const std::string&, Perturbation& into) {
    read_field(item, value, into);
  };
  return kind;
}

Field<Perturbation> milliseconds(double high, double Perturbation::*member) {
  return field<Perturbation>({.name = "ms", .meaning = "how much later", .unit = "ms", .range = {0.0, high, false}},
                             member);
}

const FieldTable<StateNoise>& noise_fields() {
  constexpr FieldRange kDeviation = {0.0, 100.0};
  static const FieldTable<StateNoise> table = {
      field<StateNoise>({.name = "q", .meaning = "of joint angles", .unit = "rad", .range = kDeviation},
                        &StateNoise::q),
      field<StateNoise>({.name = "v", .meaning = "of joint velocities", .unit = "rad/s", .range = kDeviation},
                        &StateNoise::v),
      field<StateNoise>(
          {.name = "w", .meaning = "of the base's angular velocity", .unit = "rad/s", .range = kDeviation},
          &StateNoise::w),
      field<StateNoise>({.name = "gravity", .meaning = "of the base's tilt", .unit = "rad", .range = kDeviation},
                        &StateNoise::gravity)};
  return table;
}

const FieldTable<PushPlan>& push_fields() {
  static const FieldTable<PushPlan> table = {
      field<PushPlan>({.name = "force", .meaning = "at the centre of mass", .unit = "N", .range = {0.0, 5000.0, false}},
                      &PushPlan::force),
      field<PushPlan>({.name = "duration", .meaning = "of each push", .unit = "s", .range = {0.02, 60.0}},
                      &PushPlan::duration),
      field<PushPlan>({.name = "every",
                       .meaning = "from begin to begin, not below `duration`; the first begins after half of it",
                       .unit = "s",
                       .range = {0.02, 600.0}},
                      &PushPlan::every, &PushPlan::duration),
      field<PushPlan>({.name = "link", .meaning = "a link; where there is none the card's push_link"},
                      &PushPlan::link)};
  return table;
}

const FieldTable<KickPlan>& kick_fields() {
  static const FieldTable<KickPlan> table = {
      field<KickPlan>({.name = "speed", .meaning = "the change", .unit = "m/s", .range = {0.0, 20.0, false}},
                      &KickPlan::speed),
      field<KickPlan>({.name = "first", .meaning = "when the first one comes", .unit = "s", .range = kEpisodeTime},
                      &KickPlan::first),
      field<KickPlan>({.name = "from", .meaning = "shortest time to the next", .unit = "s", .range = {0.02, 600.0}},
                      &KickPlan::from),
      field<KickPlan>({.name = "to",
                       .meaning = "longest time to the next, not below `from`; drawn between the two",
                       .unit = "s",
                       .range = {0.02, 600.0}},
                      &KickPlan::to, &KickPlan::from)};
  return table;
}

const FieldTable<AddedMass>& mass_fields() {
  static const FieldTable<AddedMass> table = {
      field<AddedMass>({.name = "link", .meaning = "a link; where there is none the card's push_link"},
                       &AddedMass::link),
      field<AddedMass>({.name = "add",
                        .meaning = "at the link's centre of mass; below 0 it is taken away",
                        .unit = "kg",
                        .range = {-100.0, 100.0}},
                       &AddedMass::add)};
  return table;
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

// What the controller and the robot meet.
void add_body_kinds(Kinds& list) {
  using P = Perturbation;
  list.push_back(valued("delay", "the controller sees the state of so many control ticks (20 ms) ago",
                        field<P>({.name = "ticks", .meaning = "how many", .range = {1, 50}}, &P::delay_ticks), "2"));
  list.push_back(valued("latency", "a command takes effect so much later, to the nearest physics step",
                        milliseconds(500.0, &P::latency_ms), "20"));
  list.push_back(planned(
      "noise",
      "what the controller measures is noisy: standard deviations, drawn every tick; what a mapping does not "
      "name has none",
      noise_fields(), [](auto& p) -> auto& { return p.noise; }, StateNoise{0.0, 0.0, 0.0, 0.0}));
  list.push_back(planned(
      "push", "a level force at a link, from time to time, each in a direction drawn for it", push_fields(),
      [](auto& p) -> auto& { return p.push; }));
  list.push_back(planned(
      "kick", "the whole robot's velocity changes at once, level, from time to time, in a direction drawn for each",
      kick_fields(), [](auto& p) -> auto& { return p.kick; }));
  list.push_back(plain(
      field<P>({.name = "friction", .meaning = "of the robot and the ground, otherwise 0.8", .range = {0.0, 10.0}},
               &P::friction),
      "0.4"));
  list.push_back(planned(
      "mass", "a link has more mass than the controller knows", mass_fields(),
      [](auto& p) -> auto& { return p.mass; }));
}

// What the policy sees of its partner; physics, detectors and recording have the real one.
void add_perception_kinds(Kinds& list) {
  using P = Perturbation;
  list.push_back(valued("jitter", "the partner's joints are seen with noise, drawn anew every tick",
                        field<P>(
                            {.name = "sigma",
                             .meaning = "standard deviation on each axis of each joint",
                             .unit = "m",
                             .range = {0.0, 1.0, false}},
                            [](auto& p) -> auto& { return p.perception.jitter; }),
                        "0.02"));
  list.push_back(valued("dropout", "a joint of the partner is not seen at a tick and keeps its last seen place",
                        field<P>(
                            {.name = "p", .meaning = "probability per joint and tick", .range = {0.0, 1.0, false}},
                            [](auto& p) -> auto& { return p.perception.dropout; }),
                        "0.1"));
  list.push_back(valued("perception_latency",
                        "the partner is seen as so long ago, to the nearest tick; at first as at the start",
                        field<P>(
                            {.name = "ms", .meaning = "how long ago", .unit = "ms", .range = {0.0, 5000.0, false}},
                            [](auto& p) -> auto& { return p.perception.latency_ms; }),
                        "200"));
  list.push_back(valued("vanish", "the partner is not seen from then on: the last seen pose stays",
                        field<P>(
                            {.name = "at", .meaning = "when", .unit = "s", .range = kEpisodeTime},
                            [](auto& p) -> auto& { return p.perception.vanish; }),
                        "2"));
  list.push_back(planned(
      "freeze", "the partner is seen as at that time for so long", freeze_fields(),
      [](auto& p) -> auto& { return p.perception.freeze; }));
  list.push_back(planned(
      "jump", "the partner is seen so far from its place from then on", jump_fields(),
      [](auto& p) -> auto& { return p.perception.jump; }));
}

Kinds make_kinds() {
  Kinds list;
  list.reserve(15);
  add_body_kinds(list);
  add_perception_kinds(list);
  list.push_back(valued("plan_latency",
                        "a policy's plan arrives so much later, to the nearest tick; until then the plan before holds",
                        milliseconds(2000.0, &Perturbation::plan_latency_ms), "100"));
  list.push_back(planned(
      "partner", "the partner moves otherwise than in the clip", partner_fields(),
      [](auto& p) -> auto& { return p.partner; }));
  return list;
}

}  // namespace

const Kinds& perturbation_kind_table() {
  static const Kinds table = make_kinds();
  return table;
}

}  // namespace duet
