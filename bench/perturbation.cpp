#include "bench/perturbation.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "bench/suite_names.h"
#include "bench/yaml_range.h"
#include "core/names.h"
#include "core/require.h"

namespace duet {
namespace {

constexpr double kDefaultFriction = 0.4;
constexpr int kDefaultDelay = 2;
constexpr double kDefaultLatency = 20.0, kDefaultPlanLatency = 100.0;  // [ms]

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

Perturbation read_kinds(const YamlSection& top, const std::string& file) {
  Perturbation perturbation;
  const auto below = [&](const char* kind, std::initializer_list<const char*> keys) {
    return YamlSection(file, top.node(kind), kind, keys);
  };
  if (top.has("delay")) perturbation.delay_ticks = whole_ticks(below("delay", {"ticks"}));
  if (top.has("latency"))
    perturbation.latency_ms = in_range(below("latency", {"ms"}), "ms", kDefaultLatency, {0.0, 500.0, false});
  if (top.has("noise")) perturbation.noise = read_noise(below("noise", {"q", "v", "w", "gravity"}));
  if (top.has("push")) perturbation.push = read_push(below("push", {"force", "duration", "every", "link"}));
  if (top.has("friction")) perturbation.friction = in_range(top, "friction", kDefaultFriction, {0.0, 10.0, true});
  if (top.has("mass")) perturbation.mass = read_mass(below("mass", {"link", "add"}));
  perturbation.perception = read_perception(top, file);
  if (top.has("plan_latency"))
    perturbation.plan_latency_ms =
        in_range(below("plan_latency", {"ms"}), "ms", kDefaultPlanLatency, {0.0, 2000.0, false});
  if (top.has("partner")) perturbation.partner = read_partner_variation(top, file);
  return perturbation;
}

std::vector<std::string> kinds_of(const YamlSection& item) {
  std::vector<std::string> kinds;
  for (const std::string& kind : perturbation_kinds())
    if (item.has(kind.c_str())) kinds.push_back(kind);
  return kinds;
}

// A kind by its name alone.
YAML::Node default_item(const std::string& kind) {
  YAML::Node item;
  item[kind] = kind == "friction" ? YAML::Node(kDefaultFriction) : YAML::Node(YAML::NodeType::Map);
  return item;
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
  const YamlSection item(file, node, "perturbation",
                         {"name", "delay", "latency", "noise", "push", "friction", "mass", "jitter", "dropout",
                          "perception_latency", "vanish", "freeze", "jump", "plan_latency", "partner"});
  const std::vector<std::string> kinds = kinds_of(item);
  if (kinds.empty())
    item.fail(line, fmt::format("expected at least one of {}, found none", fmt::join(perturbation_kinds(), ", ")));
  Perturbation perturbation = read_kinds(item, file);
  perturbation.name = item.has("name") ? item.text("name") : fmt::format("{}", fmt::join(kinds, "+"));
  if (perturbation.name == kCleanName) item.fail(item.line("name"), "name: 'clean' is the arm without a perturbation");
  if (!is_plain_name(perturbation.name))
    item.fail(item.line("name"), fmt::format("name: {}", plain_name_message(perturbation.name)));
  return perturbation;
}

}  // namespace

const std::vector<std::string>& perturbation_kinds() {
  static const std::vector<std::string> kinds = [] {
    std::vector<std::string> all = {"delay", "latency", "noise", "push", "friction", "mass"};
    all.insert(all.end(), perception_kinds().begin(), perception_kinds().end());
    all.insert(all.end(), {"plan_latency", "partner"});
    return all;
  }();
  return kinds;
}

Perturbation default_perturbation(const std::string& kind) {
  if (kind == kCleanName) return {};
  std::vector<std::string> known = perturbation_kinds();
  known.insert(known.begin(), kCleanName);
  if (std::find(known.begin(), known.end(), kind) == known.end())
    throw std::invalid_argument(unknown_name_message("perturbation", kind, known));
  Perturbation perturbation = read_kinds({kind, default_item(kind), "perturbation", {kind.c_str()}}, kind);
  perturbation.name = kind;
  return perturbation;
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
  if (perturbation.delay_ticks > 0) parts.push_back(fmt::format("delay: {{ticks: {}}}", perturbation.delay_ticks));
  if (perturbation.latency_ms > 0.0) parts.push_back(fmt::format("latency: {{ms: {}}}", perturbation.latency_ms));
  if (const auto& noise = perturbation.noise)
    parts.push_back(
        fmt::format("noise: {{q: {}, v: {}, w: {}, gravity: {}}}", noise->q, noise->v, noise->w, noise->gravity));
  if (const auto& push = perturbation.push)
    parts.push_back(fmt::format("push: {{force: {}, duration: {}, every: {}, link: {}}}", push->force, push->duration,
                                push->every, push->link));
  if (perturbation.friction) parts.push_back(fmt::format("friction: {}", *perturbation.friction));
  if (const auto& mass = perturbation.mass)
    parts.push_back(fmt::format("mass: {{link: {}, add: {}}}", mass->link, mass->add));
  for (std::string& part : yaml_parts(perturbation.perception)) parts.push_back(std::move(part));
  if (perturbation.plan_latency_ms > 0.0)
    parts.push_back(fmt::format("plan_latency: {{ms: {}}}", perturbation.plan_latency_ms));
  if (perturbation.partner) parts.push_back(to_yaml(*perturbation.partner));
  return parts.size() == 1 ? perturbation.name : fmt::format("{{{}}}", fmt::join(parts, ", "));
}

void check_perturbation(const Perturbation& perturbation, const RobotModel& robot) {
  try {
    if (perturbation.push) static_cast<void>(robot.frame_index(perturbation.push->link));
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
  RobotLink& link = heavier->links[heavier->frames[heavier->frame_index(perturbation.mass->link)].link];
  require(link.mass + perturbation.mass->add > 0.0,
          fmt::format("link '{}' has {:.3f} kg: expected some to be left, found {:g} kg added", link.name, link.mass,
                      perturbation.mass->add));
  link.mass += perturbation.mass->add;
  return heavier;
}

}  // namespace duet
