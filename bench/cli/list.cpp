// duet list: everything that can be named.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include "backends/factory.h"
#include "bench/benchmarks/benchmark.h"
#include "bench/cli/command.h"
#include "bench/perturbation.h"
#include "bench/profile.h"
#include "controllers/controller.h"
#include "core/names.h"
#include "core/require.h"
#include "metrics/catalogue.h"
#include "metrics/detector.h"
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
  std::vector<std::string> cards = {default_card_path()};
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(cards.front()).parent_path()))
    if (entry.path().extension() == ".yaml" && entry.path() != cards.front()) cards.push_back(entry.path().string());
  std::sort(cards.begin() + 1, cards.end());
  std::vector<Listed> list;
  for (const std::string& card : cards) {
    const RobotModel robot = load_robot(card);
    list.push_back({robot.name, fmt::format("{} joints, {:.4f} kg, {}", robot.dof(), robot.total_mass(), card)});
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
      {"tasks", list_tasks},
      {"engines", list_engines},
      {"engine-options", list_engine_options},
      {"profiles", list_profiles},
      {"controllers", list_controllers},
      {"perturbations", list_perturbations},
      {"policies", list_policies},
      {"metrics", list_metrics},
      {"readings", list_readings},
      {"pair-options", list_pair_options},
      {"robots", list_robots},
      {"benchmarks", list_benchmarks},
  };
  return table;
}

void run_list(const Session& session, const std::string& what) {
  std::vector<std::string> known;
  for (const auto& [name, listing] : listings()) known.push_back(name);
  for (const auto& [name, listing] : listings()) {
    if (name != what) continue;
    nlohmann::json json = nlohmann::json::array();
    std::string text;
    for (const Listed& entry : listing()) {
      json.push_back({{"name", entry.name}, {"detail", entry.detail}});
      if (!entry.options.empty()) json.back()["options"] = entry.options;
      text += entry.detail.empty() ? entry.name + "\n" : fmt::format("{:<32} {}\n", entry.name, entry.detail);
      for (const std::string& option : entry.options) text += fmt::format("{:<34} {}\n", "", option);
    }
    print(session, text, json);
    return;
  }
  throw std::invalid_argument(unknown_name_message("list", what, known));
}

}  // namespace

void add_list(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "list", "everything that can be named", "duet list readings");
  auto what = std::make_shared<std::string>();
  command
      ->add_option("what", *what,
                   "tasks, engines, engine-options, profiles, controllers, perturbations, policies, metrics, readings, "
                   "pair-options, robots, benchmarks")
      ->required();
  command->callback([&session, what] { run_list(session, *what); });
}

}  // namespace duet::cli
