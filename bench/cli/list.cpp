// duet list: everything that can be named.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>

#include "backends/factory.h"
#include "bench/benchmarks/benchmark.h"
#include "bench/cli/command.h"
#include "bench/perturbation.h"
#include "bench/profile.h"
#include "bench/robot_cards.h"
#include "bench/shipped_suites.h"
#include "controllers/controller.h"
#include "core/names.h"
#include "core/require.h"
#include "metrics/catalogue.h"
#include "metrics/detector.h"
#include "metrics/detector_catalogue.h"
#include "metrics/readings.h"
#include "policies/policy.h"
#include "retarget/options.h"
#include "retarget/pair.h"
#include "robots/robot_model.h"

namespace duet::cli {
namespace {

struct Listed {
  std::string name, detail;
  std::vector<std::string> options = {};  // a line each
  nlohmann::json more = {};               // keys besides, for machines
};
using Listing = std::function<std::vector<Listed>()>;

std::vector<Listed> list_tasks() {
  std::vector<Listed> list;
  for (const Task task : kTasks) {
    std::vector<std::string> limits;
    for (const auto& [name, value] : thresholds(task)) limits.push_back(fmt::format("{} {:g}", name, value));
    list.push_back({std::string(to_string(task)), fmt::format("thresholds: {}", fmt::join(limits, ", "))});
  }
  return list;
}

// One entry per detector: Table S11 beside the strict set, and what the detector prints.
std::vector<Listed> list_detectors() {
  std::vector<Listed> list;
  for (const Task task : kTasks) {
    Listed entry{std::string(to_string(task)), "thresholds of Table S11, strict in brackets; figures"};
    for (const ThresholdInfo& info : threshold_catalogue()) {
      if (info.task != task) continue;
      const std::string strict = info.strict == info.paper ? "" : fmt::format(" (strict {:.4g})", info.strict);
      entry.options.push_back(fmt::format("{} {:g} {}{}: {}", info.name, info.paper, info.unit, strict, info.meaning));
      entry.more["thresholds"][std::string(info.name)] = {
          {"paper", info.paper}, {"strict", info.strict}, {"unit", info.unit}, {"meaning", info.meaning}};
    }
    for (const auto& [option, value] : strict_choices(task)) {
      entry.options.push_back(fmt::format("strict reads {}={}", option, value));
      entry.more["strict_readings"][option] = value;
    }
    for (const DetectorFigure& figure : detector_figures()) {
      if (figure.task != task) continue;
      entry.options.push_back(fmt::format("prints {} [{}]: {}", figure.name, figure.unit, figure.meaning));
      entry.more["figures"][std::string(figure.name)] = {{"unit", figure.unit}, {"meaning", figure.meaning}};
    }
    list.push_back(std::move(entry));
  }
  return list;
}

std::vector<Listed> list_engines() {
  std::vector<Listed> list;
  for (const EngineInfo& engine : engines())
    list.push_back({engine.name, engine.available ? engine.version : "absent: " + engine.reason});
  return list;
}

std::vector<Listed> list_profiles() {
  std::vector<Listed> list;
  for (const std::string& name : profile_names()) list.push_back({name, load_profile(name).about});
  return list;
}

std::vector<Listed> list_engine_options() {
  std::vector<Listed> list;
  for (const EngineInfo& engine : engines()) {
    if (!engine.available || !engine.physics) continue;
    for (const EngineOption& option : engine_module(engine.name).options) {
      const std::string values = option.choices.empty() ? fmt::format("{:g} to {:g}", option.low, option.high)
                                                        : fmt::format("{}", fmt::join(option.choices, ", "));
      list.push_back(
          {engine.name + "." + option.name, fmt::format("default {} ({}): {}", option.value, values, option.meaning)});
    }
  }
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

std::vector<Listed> list_pair_options() {
  std::vector<Listed> list;
  for (const std::string& name : pair_option_names())
    list.push_back({name, "default " + pair_option(PairOptions(), name)});
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
                    fmt::format("body {}, {}; {}", info.robot, info.walks ? "walks" : "does not walk", info.about),
                    option_lines(info.options)});
  return list;
}

std::vector<Listed> list_perturbations() {
  std::vector<Listed> list = {{kCleanName, "nothing is disturbed"}};
  for (const std::string& kind : perturbation_kinds())
    list.push_back({kind, "default " + to_yaml(default_perturbation(kind))});
  return list;
}

std::vector<Listed> list_robots() {
  std::vector<Listed> list;
  for (const std::string& card : shipped_cards()) {
    const RobotModel robot = load_robot(card);
    list.push_back({robot.name, fmt::format("{} joints, {:.4f} kg, {}", robot.dof(), robot.total_mass(), card)});
  }
  return list;
}

std::vector<Listed> list_suites() {
  std::vector<Listed> list;
  for (const std::string& name : shipped_suite_names()) {
    const ShippedSuite suite = shipped_suite(name);
    list.push_back({name, fmt::format("{}, {} episodes: {}", suite.version, suite.episodes, suite.question)});
  }
  return list;
}

std::vector<Listed> list_benchmarks() {
  std::vector<Listed> list;
  for (const Benchmark& benchmark : benchmarks()) list.push_back({benchmark.name, benchmark.description});
  return list;
}

const std::vector<std::pair<std::string, Listing>>& listings() {
  static const std::vector<std::pair<std::string, Listing>> table = {
      {"tasks", list_tasks},       {"detectors", list_detectors},
      {"engines", list_engines},   {"engine-options", list_engine_options},
      {"profiles", list_profiles}, {"controllers", list_controllers},
      {"suites", list_suites},     {"perturbations", list_perturbations},
      {"policies", list_policies}, {"metrics", list_metrics},
      {"readings", list_readings}, {"pair-options", list_pair_options},
      {"robots", list_robots},     {"benchmarks", list_benchmarks},
  };
  return table;
}

void run_list(const Session& session, const std::string& what) {
  for (const auto& [name, listing] : listings()) {
    if (name != what) continue;
    nlohmann::json json = nlohmann::json::array();
    std::string text;
    for (const Listed& entry : listing()) {
      json.push_back({{"name", entry.name}, {"detail", entry.detail}});
      if (!entry.options.empty()) json.back()["options"] = entry.options;
      if (!entry.more.is_null()) json.back().update(entry.more);
      text += entry.detail.empty() ? entry.name + "\n" : fmt::format("{:<32} {}\n", entry.name, entry.detail);
      for (const std::string& option : entry.options) text += fmt::format("{:<34} {}\n", "", option);
    }
    print(session, text, json);
    return;
  }
  throw std::invalid_argument(unknown_name_message("list", what, listing_names()));
}

}  // namespace

std::vector<std::string> listing_names() {
  std::vector<std::string> names;
  for (const auto& [name, listing] : listings()) names.push_back(name);
  return names;
}

void add_list(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "list", "everything that can be named", "duet list readings");
  auto what = std::make_shared<std::string>();
  command
      ->add_option("what", *what,
                   "tasks, detectors, engines, engine-options, profiles, controllers, suites, perturbations, policies, "
                   "metrics, readings, pair-options, robots, benchmarks")
      ->required();
  command->callback([&session, what] { run_list(session, *what); });
}

}  // namespace duet::cli
