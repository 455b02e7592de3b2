// duet list: everything that can be named.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/app/command.h"
#include "duet/app/option_sections.h"
#include "duet/app/part.h"
#include "duet/app/reference_pages.h"
#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/controller.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/actuation_limits.h"
#include "duet/experiment/plan/shipped_suites.h"
#include "duet/experiment/suite/profile.h"
#include "duet/experiment/suite_file/suite_key.h"
#include "duet/io/channel.h"
#include "duet/metrics/catalogue.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/readings.h"
#include "duet/motion/layouts/joint_layout.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/policy.h"
#include "duet/retarget/options.h"
#include "duet/retarget/solver/pair.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/robot_model.h"
#include "duet/rollout/perturbations/perturbation.h"
#include "duet/rollout/perturbations/perturbation_kind.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/groups/database.h"

namespace duet::cli {
namespace {

using Listing = std::function<std::vector<Listed>()>;

bool is_of_the_paper(Task task) { return std::ranges::find(kPaperTasks, task) != kPaperTasks.end(); }

std::vector<Listed> list_tasks() {
  std::vector<Listed> list;
  for (const Task task : all_tasks()) {
    std::vector<std::string> limits;
    for (const auto& [name, value] : thresholds(task)) limits.push_back(fmt::format("{} {:g}", name, value));
    list.push_back({std::string(to_string(task)), fmt::format("thresholds: {}", fmt::join(limits, ", "))});
  }
  return list;
}

// One entry per detector: the thresholds of Table S11, or of a task that it does not have, beside the strict set, and
// what the detector prints.
std::vector<Listed> list_detectors() {
  std::vector<Listed> list;
  for (const Task task : all_tasks()) {
    Listed entry{std::string(to_string(task)), is_of_the_paper(task)
                                                   ? "thresholds of Table S11, strict in brackets; figures"
                                                   : "thresholds of duet, strict in brackets; figures"};
    for (const ThresholdInfo& info : threshold_catalogue(task)) {
      const std::string strict = info.strict == info.paper ? "" : fmt::format(" (strict {:.4g})", info.strict);
      entry.options.push_back(fmt::format("{} {:g} {}{}: {}", info.name, info.paper, info.unit, strict, info.meaning));
      entry.more["thresholds"][std::string(info.name)] = {
          {"paper", info.paper}, {"strict", info.strict}, {"unit", info.unit}, {"meaning", info.meaning}};
    }
    for (const RuleThreshold& threshold : rule_thresholds(task)) {
      entry.options.push_back(
          fmt::format("act {} {:g}{}: {}", threshold.name, threshold.value, threshold.unit, threshold.meaning));
      entry.more["act"][std::string(threshold.name)] = {
          {"value", threshold.value}, {"unit", threshold.unit}, {"meaning", threshold.meaning}};
    }
    for (const DetectorFigure& figure : rule_figures(task)) {
      entry.options.push_back(fmt::format("act prints {} [{}]: {}", figure.name, figure.unit, figure.meaning));
      entry.more["act_figures"][std::string(figure.name)] = {{"unit", figure.unit}, {"meaning", figure.meaning}};
    }
    for (const auto& [option, value] : strict_choices(task)) {
      entry.options.push_back(fmt::format("strict reads {}={}", option, value));
      entry.more["strict_readings"][option] = value;
    }
    for (const DetectorFigure& figure : detector_figures(task)) {
      entry.options.push_back(fmt::format("prints {} [{}]: {}", figure.name, figure.unit, figure.meaning));
      entry.more["figures"][std::string(figure.name)] = {{"unit", figure.unit}, {"meaning", figure.meaning}};
    }
    list.push_back(std::move(entry));
  }
  return list;
}

std::vector<Listed> list_engines() {
  std::vector<Listed> list = {
      {std::string(kPlaybackEngine), "no physics: the robot is where its reference was a tick ago (an arm of suites)"}};
  for (const EngineInfo& engine : engines())
    list.push_back({engine.name, engine.available ? engine.version : "absent: " + engine.reason});
  return list;
}

std::vector<Listed> list_profiles() {
  std::vector<Listed> list;
  for (const std::string& name : profile_names()) list.push_back({name, load_profile(name).about});
  return list;
}

std::vector<Listed> list_metrics() {
  std::vector<Listed> list;
  for (const MetricInfo& metric : metric_catalogue()) {
    const char* better = metric.direction == Direction::kLower    ? "lower is better"
                         : metric.direction == Direction::kHigher ? "higher is better"
                                                                  : "no direction";
    list.push_back(
        {std::string(metric.name), fmt::format("{} [{}], {}; {}", metric.title, metric.unit, better, metric.source)});
  }
  return list;
}

std::vector<Listed> list_readings() {
  std::vector<Listed> list;
  for (const std::string& option : reading_names())
    list.push_back({option, fmt::format("{}", fmt::join(reading_values(option), ", "))});
  return list;
}

std::vector<Listed> list_joint_layouts() {
  std::vector<Listed> list;
  for (const std::string& name : joint_layout_names()) {
    const JointLayout& layout = joint_layout(name);
    list.push_back({name,
                    fmt::format("{} joints{}{}", layout.names.size(), layout.has_toes() ? "" : ", toes are made up",
                                layout.has_gaps ? ", short gaps (NaN) are filled" : ""),
                    {fmt::format("{}", fmt::join(layout.names, ", "))},
                    {{"joints", layout.names}}});
  }
  return list;
}

// "force (60): a number above 0, at most 5000 N; at the centre of mass", and the same for machines.
template <typename Row>
std::string field_line(const Row& row) {
  return fmt::format("{}{}: {}{}{}", row.name, row.fallback.empty() ? "" : fmt::format(" ({})", row.fallback),
                     row.values, row.meaning.empty() ? "" : "; ", row.meaning);
}
template <typename Row>
nlohmann::json field_json(const Row& row) {
  return {{"name", row.name}, {"default", row.fallback}, {"values", row.values}, {"meaning", row.meaning}};
}

// "mujoco.iterations": of whom, and the option.
std::vector<Listed> listed_options(const std::vector<OptionSection>& sections) {
  std::vector<Listed> list;
  for (const OptionSection& section : sections)
    for (const FieldRow& row : section.rows)
      list.push_back(
          {section.name + "." + row.name,
           fmt::format("{} ({}): {}", row.fallback.empty() ? "no default" : "default " + row.fallback, row.values,
                       row.meaning),
           {},
           {{"of", section.name}, {"default", row.fallback}, {"values", row.values}, {"meaning", row.meaning}}});
  return list;
}

template <std::vector<OptionSection> sections()>
std::vector<Listed> list_options() {
  return listed_options(sections());
}

std::vector<Listed> list_pair_options() {
  std::vector<Listed> list;
  for (const FieldRow& row : field_rows(pair_option_table(), PairOptions()))
    list.push_back(
        {row.name, fmt::format("default {} ({}): {}", row.fallback, row.values, row.meaning), {}, field_json(row)});
  return list;
}

std::vector<Listed> list_suite_keys() {
  std::vector<Listed> list;
  for (const SuiteKey& key : suite_keys())
    for (const FieldRow& row : key.rows)
      list.push_back({row.name,
                      fmt::format("{} ({}): {}", row.fallback.empty() ? "no default" : "default " + row.fallback,
                                  row.values, row.meaning),
                      {},
                      field_json(row)});
  return list;
}

std::vector<Listed> list_channels() {
  std::vector<Listed> list;
  for (const ChannelRow& row : channel_table()) {
    Listed entry{*row.controller != '\0' ? row.controller : (*row.policy != '\0' ? row.policy : row.network),
                 fmt::format("{}; {}", row.numbers, row.meaning)};
    for (const auto& [format, name] :
         {std::pair{"IO descriptor", row.controller}, {"policy", row.policy}, {"network", row.network}})
      if (*name != '\0') entry.options.push_back(fmt::format("{}: {}", format, name));
    entry.more = {{"controller", row.controller},
                  {"policy", row.policy},
                  {"network", row.network},
                  {"keys", channel_keys(row.kind)},
                  {"numbers", row.numbers}};
    list.push_back(std::move(entry));
  }
  return list;
}

std::vector<Listed> list_row_fields() {
  std::vector<Listed> list;
  for (const RowFieldInfo& info : row_field_list()) {
    Listed entry{info.name, fmt::format("{}; {}", info.type, info.meaning)};
    entry.more = {{"type", info.type}, {"meaning", info.meaning}, {"columns", info.columns}};
    for (const RowFieldInfo& member : info.members) {
      entry.options.push_back(fmt::format("{}: {}; {}", member.name, member.type, member.meaning));
      entry.more["members"].push_back({{"name", member.name}, {"type", member.type}, {"meaning", member.meaning}});
    }
    list.push_back(std::move(entry));
  }
  return list;
}

template <typename Option>
std::vector<std::string> option_lines(const std::vector<Option>& options) {
  std::vector<std::string> lines;
  lines.reserve(options.size());
  for (const Option& option : options)
    lines.push_back(fmt::format("{} ({}): {}", option.name,
                                option.fallback.empty() ? "no default" : "default " + option.fallback, option.about));
  return lines;
}

std::vector<Listed> list_policies() {
  std::vector<Listed> list;
  for (const PolicyInfo& info : policies()) list.push_back({info.name, info.about, option_lines(info.options)});
  return list;
}

std::vector<Listed> list_controllers() {
  std::vector<Listed> list;
  for (const ControllerInfo& info : controllers())
    list.push_back({info.name,
                    fmt::format("body {}, {}; {}", info.robot.empty() ? "any" : info.robot,
                                info.walks ? "walks" : "does not walk", info.about),
                    option_lines(info.options)});
  return list;
}

nlohmann::json step_json(const ExplicitStep& step, const std::string& joint) {
  return {{"joint", joint}, {"largest_step_s", std::isfinite(step.largest) ? nlohmann::json(step.largest) : nullptr}};
}

Listed stability_on(const ControllerInfo& info, const std::string& card) {
  const std::shared_ptr<const RobotModel> robot = load_shared_robot(card);
  Listed entry{info.name + " on " + robot->name, "", {}, {{"controller", info.name}, {"robot", robot->name}}};
  try {
    const ActuationLimits limits = actuation_limits(robot, standing_gains(info.name, robot));
    entry.detail = to_text(limits);
    entry.more["with_armature"] = step_json(limits.with_armature, limits.joint_with_armature);
    entry.more["bare"] = step_json(limits.bare, limits.joint_bare);
  } catch (const MissingError& error) {
    entry.detail = fmt::format("not known: {}", error.what());
  }
  return entry;
}

// The largest step of the explicit law for each controller on its robot; for one of any robot, on those that ship.
std::vector<Listed> list_stability() {
  std::vector<Listed> list;
  for (const ControllerInfo& info : controllers()) {
    if (!info.robot.empty()) {
      list.push_back(stability_on(info, info.robot));
      continue;
    }
    for (const RobotCardFile& card : robot_cards()) list.push_back(stability_on(info, card.path));
  }
  return list;
}

std::vector<Listed> list_perturbations() {
  std::vector<Listed> list = {{kCleanName, "nothing is disturbed"}};
  for (const PerturbationKind& kind : perturbation_kind_table()) {
    Listed entry{kind.name, fmt::format("{}; default {}", kind.meaning, to_yaml(default_perturbation(kind.name)))};
    for (const FieldRow& row : kind.rows) {
      entry.options.push_back(row.name.empty() ? row.values : field_line(row));
      entry.more["fields"].push_back(field_json(row));
    }
    list.push_back(std::move(entry));
  }
  return list;
}

std::vector<Listed> list_robots() {
  std::vector<Listed> list;
  for (const RobotCardFile& card : robot_cards()) {
    try {
      const RobotModel robot = load_robot(card.path);
      list.push_back({card.name, fmt::format("{} joints, {:.4f} kg, {} ({})", robot.dof(), robot.total_mass(),
                                             card.folder, card.path)});
    } catch (const InputError& error) {
      list.push_back({card.name, fmt::format("broken: {}", error.what())});
    }
  }
  return list;
}

std::vector<Listed> list_suites() {
  std::vector<Listed> list;
  for (const std::string& name : shipped_suite_names()) {
    const ShippedSuite suite = shipped_suite(name);
    const std::string size = suite.clips_given ? "clips of your own" : fmt::format("{} episodes", suite.episodes);
    list.push_back({name, fmt::format("{}, {}: {}", suite.version, size, suite.question)});
  }
  return list;
}

std::vector<Listed> list_benchmarks() {
  std::vector<Listed> list;
  for (const Benchmark& benchmark : benchmarks()) list.push_back({benchmark.name, benchmark.description});
  return list;
}

struct ListPlace {
  std::string name;
  Listing own;       // empty: a part's
  std::string part;  // whose
};

// In the order of help.
const std::vector<ListPlace>& list_places() {
  static const std::vector<ListPlace> table = {
      {"tasks", list_tasks, {}},
      {"detectors", list_detectors, {}},
      {"engines", list_engines, {}},
      {"engine-options", list_options<engine_option_sections>, {}},
      {"profiles", list_profiles, {}},
      {"controllers", list_controllers, {}},
      {"controller-options", list_options<controller_option_sections>, {}},
      {"channels", list_channels, {}},
      {"suites", list_suites, {}},
      {"suite-keys", list_suite_keys, {}},
      {"perturbations", list_perturbations, {}},
      {"policies", list_policies, {}},
      {"policy-options", list_options<policy_option_sections>, {}},
      {"metrics", list_metrics, {}},
      {"readings", list_readings, {}},
      {"pair-options", list_pair_options, {}},
      {"synth-options", list_options<synth_option_sections>, {}},
      {"train-options", {}, "training"},
      {"people-formats", {}, "data"},
      {"joint-layouts", list_joint_layouts, {}},
      {"curation-criteria", {}, "data"},
      {"robots", list_robots, {}},
      {"row-fields", list_row_fields, {}},
      {"benchmarks", list_benchmarks, {}},
      {"robot-formats", {}, "data"},
  };
  return table;
}

// Empty where the part is absent whose list it is.
Listing listing_of(const ListPlace& place) {
  if (place.own) return place.own;
  if (const auto sections = in_parts(&Part::option_lists, place.name))
    return [sections] { return listed_options(sections()); };
  return in_parts(&Part::lists, place.name);
}

void print_list(const Session& session, const std::vector<Listed>& list) {
  nlohmann::json json = nlohmann::json::array();
  std::string text;
  for (const Listed& entry : list) {
    json.push_back({{"name", entry.name}, {"detail", entry.detail}});
    if (!entry.options.empty()) json.back()["options"] = entry.options;
    if (!entry.more.is_null()) json.back().update(entry.more);
    text += entry.detail.empty() ? entry.name + "\n" : fmt::format("{:<32} {}\n", entry.name, entry.detail);
    for (const std::string& option : entry.options) text += fmt::format("{:<34} {}\n", "", option);
  }
  print(session, text, json);
}

void run_list(const Session& session, const std::string& what) {
  for (const ListPlace& place : list_places()) {
    if (place.name != what) continue;
    const Listing listing = listing_of(place);
    if (!listing) throw MissingError(missing_part_message(fmt::format("`duet list {}`", what), place.part));
    return print_list(session, listing());
  }
  throw std::invalid_argument(unknown_name_message("list", what, listing_names()));
}

}  // namespace

std::vector<std::string> listing_names() {
  std::vector<std::string> names;
  for (const ListPlace& place : list_places())
    if (listing_of(place)) names.push_back(place.name);
  return names;
}

void add_list(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "list", "everything that can be named", "duet list readings");
  auto what = std::make_shared<std::string>();
  command->add_option("what", *what, fmt::format("{}", fmt::join(listing_names(), ", ")))->required();
  auto markdown = std::make_shared<bool>(false);
  command->add_flag("--markdown", *markdown,
                    fmt::format("as a page of docs/reference: {}", fmt::join(reference_page_names(), ", ")));
  auto stability = std::make_shared<bool>(false);
  command->add_flag(
      "--stability", *stability,
      "of controllers: the largest step of the explicit torque law for each robot, and the joint that sets it");
  command->callback([&session, what, markdown, stability] {
    require(!*stability || *what == "controllers", "--stability: expected `duet list controllers`, found '{}'", *what);
    if (*stability) return print_list(session, list_stability());
    if (*markdown) return print(session, reference_page(*what), {{"markdown", reference_page(*what)}});
    run_list(session, *what);
  });
}

}  // namespace duet::cli
