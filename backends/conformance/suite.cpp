#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "duet/backends/conformance/conformance.h"
#include "duet/backends/conformance/trial.h"
#include "duet/backends/engine_module.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"

namespace duet::conformance {
namespace {

constexpr std::array kScenes = {
    ConformanceScene{"state", "a state set is the state that the engine steps from, link by link", measure_state},
    ConformanceScene{"acceleration", "accelerations of the robot in random states are those of our Newton-Euler",
                     measure_acceleration},
    ConformanceScene{"free-flight", "0.2 s of the robot in the air against our Runge-Kutta integration",
                     measure_free_flight, kLawGroup},
    ConformanceScene{"momentum", "inner forces of a thrashing robot without gravity leave its momentum",
                     measure_momentum, kLawGroup},
    ConformanceScene{"box-simple", "a box thrown with a slow spin about a principal axis", measure_box_simple},
    ConformanceScene{"box-complex", "a box tumbling about its intermediate axis", measure_box_complex},
    ConformanceScene{"pendulum", "period and energy of a pendulum at 90 degrees", measure_pendulum},
    ConformanceScene{"chain", "a chain of two links against our Runge-Kutta integration", measure_chain},
    ConformanceScene{"armature", "a wheel accelerates with torque over inertia plus armature", measure_armature,
                     kLawGroup},
    ConformanceScene{"effort", "the effort limits PD and feed-forward together, armature apart", measure_effort,
                     kLawGroup},
    ConformanceScene{"step-response", "a joint under PD is the damped oscillator of its gains", measure_step_response,
                     kLawGroup},
    ConformanceScene{"saturation", "all joints of the robot with a step beyond their effort, against our law at 0.1 ms",
                     measure_saturation, kLawGroup},
    ConformanceScene{"law", "both laws, with and without armature, are their own recursions at one joint", measure_law,
                     kLawGroup},
    ConformanceScene{"joint-stop", "a driven joint stops at its limit", measure_joint_stop},
    ConformanceScene{"incline", "slip angle and sliding on an incline along x, y and the diagonal", measure_incline},
    ConformanceScene{"rolling-ball", "a sliding ball comes to roll", measure_rolling_ball},
    ConformanceScene{"skin-bounce", "a ball on the skin of a human capsule, held or in motion, is a mass on a spring",
                     measure_skin_bounce, "", nullptr, true},
    ConformanceScene{"skin-rub", "a partner's limb that slides past a hand drags it by the pair's friction",
                     measure_skin_rub, "", nullptr, true},
    ConformanceScene{"skin-strike", "a driven hand strikes a partner's limb: skin and torque law give way in one step",
                     measure_skin_strike, kLawGroup, nullptr, true},
    ConformanceScene{"skin-carry", "a partner that moves on carries a sledge along, by mu g until both move alike",
                     measure_skin_carry, "", nullptr, true},
    ConformanceScene{"self-rub", "a forearm pressed on a turning thigh brakes it by the pair's friction",
                     measure_self_rub},
    ConformanceScene{"ground-bounce", "the ground does not give energy back", measure_ground_bounce},
    ConformanceScene{"stand", "the robot stands under ankle feedback and its weight is carried", measure_stand,
                     kLawGroup, lacks_ankles},
    ConformanceScene{"fall", "the robot without feedback falls at the same time everywhere", measure_fall, kLawGroup,
                     lacks_soles},
    ConformanceScene{"held-push", "a person pushes the torso and holds: momentum, peak and held force",
                     measure_held_push, kLawGroup, lacks_trunk_or_ankles, true},
    ConformanceScene{"self-collision", "a hand sent into the trunk is stopped, momentum stays", measure_self_collision,
                     kLawGroup, lacks_hand_poses},
    ConformanceScene{"repeat", "snapshot in contact, rerun, second thread and reset continue bitwise", measure_repeat},
};

void run_measurements(const ConformanceScene& scene, const std::string& engine, const Settings& settings,
                      SceneRun& run) {
  Trial trial(engine, settings, std::string(scene.name), run);
  if (scene.with_partner && !trial.no_partner().empty()) {
    trial.unsupported("solid partner", trial.no_partner());
    return;
  }
  try {
    scene.measure(trial);
  } catch (const std::exception& error) {
    trial.absolute("ran to its end", "", settings.dt, 0.0, 1.0, 0.0, error.what());
  }
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

using QuantityKey = std::tuple<std::string, std::string, double>;

QuantityKey key_of(const Measurement& measurement) { return {measurement.scene, measurement.quantity, measurement.dt}; }

template <typename Report, typename Action>
void for_each_measurement(Report& report, Action&& action) {
  for (auto& scene : report.scenes)
    for (auto& measurement : scene.run.measurements) action(measurement);
}

}  // namespace

double error_of(const Measurement& measurement) {
  const double error = std::abs(measurement.value - measurement.expected);
  return measurement.relative ? error / std::abs(measurement.expected) : error;
}

std::span<const ConformanceScene> scenes() { return kScenes; }

const ConformanceScene& find_scene(std::string_view name) { return entry_named(kScenes, "conformance scene", name); }

SceneRun run_scene(const ConformanceScene& scene, const std::string& engine, const Settings& settings) {
  static_cast<void>(engine_module(engine));
  Settings with_robot = settings;
  if (with_robot.robot == nullptr)
    with_robot.robot = std::make_shared<const RobotModel>(load_robot(default_card_path()));
  SceneRun run;
  if (scene.lacks != nullptr) run.skipped = scene.lacks(*with_robot.robot);
  if (!run.skipped.empty()) return run;
  run_measurements(scene, engine, with_robot, run);
  return run;
}

std::string_view to_string(CheckStatus verdict) {
  switch (verdict) {
    case CheckStatus::kPass:
      return "pass";
    case CheckStatus::kDeviation:
      return "deviation";
    case CheckStatus::kUnsupported:
      return "unsupported";
    case CheckStatus::kFail:
      break;
  }
  return "FAIL";
}

CheckStatus status_of(const std::string& engine, const Measurement& measurement) {
  if (measurement.unsupported) return CheckStatus::kUnsupported;
  const double error = error_of(measurement);
  if (error <= measurement.tolerance) return CheckStatus::kPass;  // false for NaN
  const EngineDeviation* known = find_deviation(engine, measurement.scene, measurement.quantity);
  if (known == nullptr) return CheckStatus::kFail;
  const double bound = measurement.of_stand_in ? known->bound : std::numeric_limits<double>::max();
  return error <= bound ? CheckStatus::kDeviation : CheckStatus::kFail;
}

EngineReport run_suite(const std::string& engine, const Settings& settings, std::span<const std::string> names) {
  EngineReport report{.engine = engine, .version = engine_module(engine).version(), .settings = settings, .scenes = {}};
  std::vector<const ConformanceScene*> chosen;
  for (const std::string& name : names) chosen.push_back(&find_scene(name));
  if (names.empty())
    for (const ConformanceScene& scene : kScenes) chosen.push_back(&scene);
  if (report.settings.robot == nullptr)
    report.settings.robot = std::make_shared<const RobotModel>(load_robot(default_card_path()));
  for (const ConformanceScene* scene : chosen)
    report.scenes.push_back({std::string(scene->name), run_scene(*scene, engine, report.settings)});
  return report;
}

void agree(std::span<EngineReport> reports) {
  std::map<QuantityKey, std::vector<double>> values;
  for (const EngineReport& report : reports)
    for_each_measurement(report, [&](const Measurement& measurement) {
      if (measurement.across_engines && std::isfinite(measurement.value))
        values[key_of(measurement)].push_back(measurement.value);
    });
  for (EngineReport& report : reports)
    for_each_measurement(report, [&](Measurement& measurement) {
      const auto found = values.find(key_of(measurement));
      if (!measurement.across_engines || found == values.end() || found->second.size() < 2) return;
      measurement.expected = median_of(found->second);
      measurement.note = fmt::format("median of {} engines", found->second.size());
    });
}

void Tally::count(CheckStatus verdict) {
  switch (verdict) {
    case CheckStatus::kPass:
      ++passed;
      break;
    case CheckStatus::kFail:
      ++failed;
      break;
    case CheckStatus::kDeviation:
      ++deviations;
      break;
    case CheckStatus::kUnsupported:
      ++unsupported;
      break;
  }
}

Tally tally(const EngineReport& report) {
  Tally tally;
  for_each_measurement(report,
                       [&](const Measurement& measurement) { tally.count(status_of(report.engine, measurement)); });
  return tally;
}

std::vector<std::string> stale_deviations(const EngineReport& report) {
  const Settings& run = report.settings;
  if (!run.options.empty() || run.dt != Settings{}.dt || run.law != Settings{}.law ||
      run.armature != Settings{}.armature)
    return {};
  std::vector<std::string> stale;
  for (const EngineDeviation& entry : deviations(report.engine)) {
    if (entry.only_at_full_effort && report.settings.effort != Effort::kFull) continue;
    bool measured = false, deviates = false;
    for_each_measurement(report, [&](const Measurement& measurement) {
      if (measurement.scene != entry.scene || !measurement.quantity.starts_with(entry.quantity)) return;
      measured = true;
      deviates = deviates || status_of(report.engine, measurement) != CheckStatus::kPass;
    });
    const bool scene_ran = std::any_of(report.scenes.begin(), report.scenes.end(), [&](const SceneReport& scene) {
      return scene.name == entry.scene && scene.run.skipped.empty();
    });
    if (scene_ran && !(measured && deviates))
      stale.push_back(fmt::format("deviation of {} in '{}', '{}': {}", report.engine, entry.scene, entry.quantity,
                                  measured ? "every measurement passes, remove the entry" : "no such quantity"));
  }
  return stale;
}

std::span<const EngineDeviation> deviations(const std::string& engine) {
  const EngineModule* module = find_engine_module(engine);
  return module == nullptr ? std::span<const EngineDeviation>() : module->deviations;
}

const EngineDeviation* find_deviation(const std::string& engine, std::string_view scene, std::string_view quantity) {
  const std::span<const EngineDeviation> known = deviations(engine);
  const auto found = std::ranges::find_if(known, [&](const EngineDeviation& entry) {
    return entry.scene == scene && quantity.starts_with(entry.quantity);
  });
  return found == known.end() ? nullptr : &*found;
}

}  // namespace duet::conformance
