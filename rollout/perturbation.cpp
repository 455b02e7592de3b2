#include "duet/rollout/perturbation.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>

#include "duet/core/names.h"
#include "duet/core/plain_name.h"
#include "duet/core/require.h"
#include "duet/robots/yaml_range.h"

namespace duet {
namespace {

constexpr int kDefaultDelay = 2;

int whole_ticks(const YamlSection& section) {
  const double value = in_range(section, "ticks", kDefaultDelay, {1.0, 50.0, true});
  if (value != std::floor(value))
    section.fail(section.line("ticks"), fmt::format("ticks: expected a whole number, found {:g}", value));
  return static_cast<int>(value);
}

// A quantity that the mapping does not name has no noise; an empty mapping stands for the default of each.
StateNoise read_noise(const YamlSection& section) {
  const bool named = section.has("q") || section.has("v") || section.has("w") || section.has("gravity");
  const StateNoise defaults = named ? StateNoise{0.0, 0.0, 0.0, 0.0} : StateNoise{};
  const auto deviation = [&](const char* key, double fallback) {
    return in_range(section, key, fallback, {0.0, 100.0, true});
  };
  return {deviation("q", defaults.q), deviation("v", defaults.v), deviation("w", defaults.w),
          deviation("gravity", defaults.gravity)};
}

PushPlan read_push(const YamlSection& section) {
  PushPlan plan;
  plan.force = in_range(section, "force", plan.force, {0.0, 5000.0, false});
  plan.duration = in_range(section, "duration", plan.duration, {0.02, 60.0, true});
  plan.every = in_range(section, "every", std::max(plan.every, plan.duration), {plan.duration, 600.0, true});
  if (section.has("link")) plan.link = section.text("link");
  return plan;
}

AddedMass read_mass(const YamlSection& section) {
  AddedMass mass;
  mass.add = in_range(section, "add", mass.add, {-100.0, 100.0, true});
  if (section.has("link")) mass.link = section.text("link");
  return mass;
}

KickPlan read_kick(const YamlSection& section) {
  KickPlan plan;
  plan.speed = in_range(section, "speed", plan.speed, {0.0, 20.0, false});
  plan.first = in_range(section, "first", plan.first, {0.0, 600.0, true});
  plan.from = in_range(section, "from", plan.from, {0.02, 600.0, true});
  plan.to = in_range(section, "to", std::max(plan.to, plan.from), {plan.from, 600.0, true});
  return plan;
}

// One kind: its key, what it means, and how it is read from the mapping of a perturbation and written into one (""
// where there is none of it). Its default is what an empty mapping, or `value`, reads as.
struct Kind {
  std::string name, meaning;
  std::function<void(const YamlSection& item, const std::string& file, Perturbation& into)> read;
  std::function<std::string(const Perturbation& of)> write;
  std::string value = "{}";
};

// A kind whose value is a mapping with these keys.
Kind kind(const std::string& name, const std::vector<const char*>& keys, const std::string& meaning,
          const std::function<void(const YamlSection& mapping, Perturbation& into)>& read,
          const std::function<std::string(const Perturbation& of)>& write) {
  const auto below = [=](const YamlSection& item, const std::string& file, Perturbation& into) {
    read(YamlSection(file, item.node(name.c_str()), name, keys), into);
  };
  return {name, meaning, below, write};
}

void add_perception(std::vector<Kind>& list) {
  for (const PerceptionKind& seen : perception_kinds())
    list.push_back(kind(
        seen.name, seen.keys, seen.meaning,
        [&seen](const YamlSection& at, Perturbation& into) { seen.read(at, into.perception); },
        [&seen](const Perturbation& of) { return seen.write(of.perception); }));
}

std::string milliseconds(double ms) { return ms > 0.0 ? fmt::format("{{ms: {}}}", ms) : ""; }

std::vector<Kind> make_kinds() {
  using P = Perturbation;
  std::vector<Kind> list = {
      kind(
          "delay", {"ticks"}, "the controller sees the state of so many ticks ago",
          [](const YamlSection& at, P& into) { into.delay_ticks = whole_ticks(at); },
          [](const P& of) { return of.delay_ticks > 0 ? fmt::format("{{ticks: {}}}", of.delay_ticks) : ""; }),
      kind(
          "latency", {"ms"}, "a command takes effect so much later",
          [](const YamlSection& at, P& into) {
            into.latency_ms = in_range(at, "ms", 20.0, {0.0, 500.0, false});
          },
          [](const P& of) { return milliseconds(of.latency_ms); }),
      kind(
          "noise", {"q", "v", "w", "gravity"}, "what the controller measures is noisy",
          [](const YamlSection& at, P& into) { into.noise = read_noise(at); },
          [](const P& of) {
            const auto& noise = of.noise;
            return noise ? fmt::format("{{q: {}, v: {}, w: {}, gravity: {}}}", noise->q, noise->v, noise->w,
                                       noise->gravity)
                         : "";
          }),
      kind(
          "push", {"force", "duration", "every", "link"}, "a level force at a link, from time to time",
          [](const YamlSection& at, P& into) { into.push = read_push(at); },
          [](const P& of) {
            const auto& push = of.push;
            return push ? fmt::format("{{force: {}, duration: {}, every: {}{}}}", push->force, push->duration,
                                      push->every, push->link.empty() ? "" : ", link: " + push->link)
                        : "";
          }),
      kind(
          "kick", {"speed", "first", "from", "to"}, "the whole robot's velocity changes at once, from time to time",
          [](const YamlSection& at, P& into) { into.kick = read_kick(at); },
          [](const P& of) {
            const auto& kick = of.kick;
            return kick ? fmt::format("{{speed: {}, first: {}, from: {}, to: {}}}", kick->speed, kick->first,
                                      kick->from, kick->to)
                        : "";
          }),
      {"friction", "of the robot and the ground",
       [](const YamlSection& item, const std::string&, P& into) {
         into.friction = in_range(item, "friction", 0.4, {0.0, 10.0, true});
       },
       [](const P& of) { return of.friction ? fmt::format("{}", *of.friction) : ""; }, "0.4"},
      kind(
          "mass", {"link", "add"}, "a link has more mass than the controller knows",
          [](const YamlSection& at, P& into) { into.mass = read_mass(at); },
          [](const P& of) {
            if (!of.mass) return std::string();
            const std::string link = of.mass->link.empty() ? "" : fmt::format("link: {}, ", of.mass->link);
            return fmt::format("{{{}add: {}}}", link, of.mass->add);
          })};
  add_perception(list);
  list.push_back(kind(
      "plan_latency", {"ms"}, "a policy's plan arrives so much later",
      [](const YamlSection& at, P& into) {
        into.plan_latency_ms = in_range(at, "ms", 100.0, {0.0, 2000.0, false});
      },
      [](const P& of) { return milliseconds(of.plan_latency_ms); }));
  list.push_back(kind(
      "partner", {"scale", "speed", "shift_s", "hesitate_s", "abort"}, "the partner moves otherwise than in the clip",
      [](const YamlSection& at, P& into) { into.partner = read_partner_variation(at); },
      [](const P& of) { return of.partner ? to_yaml(*of.partner) : ""; }));
  return list;
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> list = make_kinds();
  return list;
}

std::vector<std::string> kinds_of(const YamlSection& item) {
  std::vector<std::string> names;
  for (const Kind& known : kinds())
    if (item.has(known.name.c_str())) names.push_back(known.name);
  return names;
}

Perturbation read_kinds(const YamlSection& item, const std::string& file) {
  Perturbation perturbation;
  for (const Kind& known : kinds())
    if (item.has(known.name.c_str())) known.read(item, file, perturbation);
  return perturbation;
}

std::vector<const char*> keys_of_item() {
  std::vector<const char*> keys = {"name"};
  for (const Kind& known : kinds()) keys.push_back(known.name.c_str());
  return keys;
}

Perturbation read_item(const YamlSection& suite, const YAML::Node& node, const std::string& file) {
  const int line = std::max(node.Mark().line, 0) + 1;
  if (node.IsScalar()) {
    try {
      return default_perturbation(node.Scalar());
    } catch (const std::invalid_argument& error) {
      suite.fail(line, fmt::format("perturbations: {}", error.what()));
    }
  }
  const YamlSection item(file, node, "perturbation", keys_of_item());
  const std::vector<std::string> named = kinds_of(item);
  if (named.empty())
    item.fail(line, fmt::format("expected at least one of {}, found none", fmt::join(perturbation_kinds(), ", ")));
  Perturbation perturbation = read_kinds(item, file);
  perturbation.name = item.has("name") ? item.text("name") : fmt::format("{}", fmt::join(named, "+"));
  if (perturbation.name == kCleanName) item.fail(item.line("name"), "name: 'clean' is the arm without a perturbation");
  if (!is_plain_name(perturbation.name))
    item.fail(item.line("name"), fmt::format("name: {}", plain_name_message(perturbation.name)));
  return perturbation;
}

}  // namespace

const std::vector<std::string>& perturbation_kinds() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Kind& known : kinds()) all.push_back(known.name);
    return all;
  }();
  return names;
}

std::string meaning_of_perturbation(const std::string& kind) {
  for (const Kind& known : kinds())
    if (known.name == kind) return known.meaning;
  throw std::invalid_argument(unknown_name_message("perturbation", kind, perturbation_kinds()));
}

Perturbation default_perturbation(const std::string& kind) {
  if (kind == kCleanName) return {};
  for (const Kind& known : kinds()) {
    if (known.name != kind) continue;
    const YAML::Node item = YAML::Load(fmt::format("{{{}: {}}}", kind, known.value));
    Perturbation perturbation = read_kinds({kind, item, "perturbation", {known.name.c_str()}}, kind);
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
                 fmt::format("perturbations: '{}' is there twice; names tell rows apart", list.back().name));
  }
  if (list.empty()) suite.fail(suite.line("perturbations"), "perturbations: expected at least one, found none");
  return list;
}

std::string to_yaml(const Perturbation& perturbation) {
  std::vector<std::string> parts = {fmt::format("name: {}", perturbation.name)};
  for (const Kind& known : kinds())
    if (const std::string value = known.write(perturbation); !value.empty())
      parts.push_back(fmt::format("{}: {}", known.name, value));
  return parts.size() == 1 ? perturbation.name : fmt::format("{{{}}}", fmt::join(parts, ", "));
}

int perturbed_link(const std::string& name, const RobotModel& robot) {
  return robot.frames[name.empty() ? robot.roles.push_frame : robot.frame_index(name)].link;
}

Perturbation with_links(Perturbation perturbation, const RobotModel& robot) {
  const std::string& link = robot.frames[robot.roles.push_frame].name;
  if (perturbation.push && perturbation.push->link.empty()) perturbation.push->link = link;
  if (perturbation.mass && perturbation.mass->link.empty()) perturbation.mass->link = link;
  return perturbation;
}

void check_perturbation(const Perturbation& perturbation, const RobotModel& robot) {
  try {
    if (perturbation.push) static_cast<void>(perturbed_link(perturbation.push->link, robot));
    if (perturbation.mass) static_cast<void>(perturbed_robot(perturbation, std::make_shared<RobotModel>(robot)));
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(
        fmt::format("perturbation '{}' on robot '{}': {}", perturbation.name, robot.name, error.what()));
  }
}

std::shared_ptr<const RobotModel> perturbed_robot(const Perturbation& perturbation,
                                                  const std::shared_ptr<const RobotModel>& robot) {
  if (!perturbation.mass) return robot;
  auto heavier = std::make_shared<RobotModel>(*robot);
  RobotLink& link = heavier->links[perturbed_link(perturbation.mass->link, *robot)];
  require(link.mass + perturbation.mass->add > 0.0,
          fmt::format("link '{}' has {:.3f} kg: expected some to be left, found {:g} kg added", link.name, link.mass,
                      perturbation.mass->add));
  link.mass += perturbation.mass->add;
  return heavier;
}

}  // namespace duet
