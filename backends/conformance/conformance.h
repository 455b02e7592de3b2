// The conformance suite: small scenes that every physics engine runs through the public Backend interface, each against
// a closed form or against our own integration of our own dynamics. A scene measures; a verdict comes from a stated
// tolerance and from one table of asserted deviations (conformance.h). docs/conformance.md. Thread-safe: no state.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/engine_module.h"

namespace duet::conformance {

// quick: seconds per engine. full: more step sizes (2, 1, 1/2 and 1/4 of `dt`) and longer runs.
enum class Effort { kQuick, kFull };

// How one engine is run: what an engine profile holds.
struct Settings {
  double dt = 0.002;      // [s]
  EngineOptions options;  // what is not named has the engine's default
  TorqueLaw law = TorqueLaw::kImplicit;
  double armature = 1.0;  // share of the robot's
  Effort effort = Effort::kQuick;
  std::shared_ptr<const RobotModel> robot;  // of the scenes with a whole robot; null: the one that stands in
};

struct Measurement {
  std::string scene, quantity, unit;  // unit "" for a pure number
  double dt = 0.0;                    // that it was found with [s]
  double value = 0.0, expected = 0.0;
  double tolerance = 0.0;       // of |value - expected|, or of that over |expected|
  bool relative = false;        // which of the two
  bool of_stand_in = true;      // on the robot that stands in, which bounds of deviations and stored figures are about
  bool across_engines = false;  // `expected` is the median of the engines that ran (agree), until then a stored figure
  bool unsupported = false;     // the engine lacks what was to be measured; `note` says what
  std::string note;             // what `expected` is and what the tolerance stands for
};

// |value - expected|, over |expected| where relative; NaN for a value that is not finite.
double error_of(const Measurement& measurement);

// Error against cost of one scene at one step size: a dot of the certificate's plots.
struct AccuracyPoint {
  double dt = 0.0;     // [s]
  double error = 0.0;  // SceneRun::error, in its unit
  double cost = 0.0;   // CPU seconds of this thread per simulated second
};

struct SceneRun {
  std::vector<Measurement> measurements;
  std::string skipped;            // why nothing was measured: what the robot lacks; else ""
  std::string error, error_unit;  // what `accuracy` plots, "" where the scene has no such thing
  std::vector<AccuracyPoint> accuracy;
};

class Trial;

struct ConformanceScene {
  std::string_view name;   // "free-flight"
  std::string_view shows;  // one sentence
  void (*measure)(Trial& trial);
  // kLawGroup: what the scene asks holds under the torque law and the armature that the settings name alone; an engine
  // with others fails here and nowhere else. "": it holds whatever drives the joints.
  std::string_view group = "";
  std::string (*lacks)(const RobotModel& robot) = nullptr;  // what the scene needs of the robot and it has not, or ""
  bool with_partner = false;                                // cannot be run without a solid partner
};

inline constexpr std::string_view kLawGroup = "law";

std::span<const ConformanceScene> scenes();
// Throws std::invalid_argument with the nearest and all known names.
const ConformanceScene& find_scene(std::string_view name);

// A robot that lacks what the scene needs is no fault: the run says what. An engine that has no solid partner
// (EngineModule::no_solid_partner) has one measurement, `unsupported`, in a scene that needs it. An engine's exception,
// or its divergence, becomes a failed measurement "ran to its end" with the message. Throws what make_backend throws
// for an engine's name (unknown, absent).
SceneRun run_scene(const ConformanceScene& scene, const std::string& engine, const Settings& settings);

// kDeviation: outside its tolerance, inside the bound that its engine's module gives it. kUnsupported: not measured, as
// the engine's module says that it lacks what the check needs.
enum class CheckStatus { kPass, kFail, kDeviation, kUnsupported };
std::string_view to_string(CheckStatus verdict);  // "pass", "FAIL", "deviation", "unsupported"

CheckStatus status_of(const std::string& engine, const Measurement& measurement);

struct SceneReport {
  std::string name;
  SceneRun run;
};

struct EngineReport {
  std::string engine, version;
  Settings settings;
  std::vector<SceneReport> scenes;
};

// `names`: scenes to run; empty for all. Throws std::invalid_argument for unknown names, MissingError for an engine
// that is not there.
EngineReport run_suite(const std::string& engine, const Settings& settings, std::span<const std::string> names = {});

// Measurements across engines are compared with their median over `reports` where two or more have them.
void agree(std::span<EngineReport> reports);

struct Tally {
  int passed = 0, failed = 0, deviations = 0, unsupported = 0;

  void count(CheckStatus verdict);
  bool operator==(const Tally&) const = default;
};
Tally tally(const EngineReport& report);

// Known deviations of this engine that deviate no more: the quantity was measured and every one passed. Only for the
// default options at 2 ms, which they are about; empty for other settings.
std::vector<std::string> stale_deviations(const EngineReport& report);

// Known deviations of engines, by name of the engine (backends/engine_module.h).

// The deviations that the engine's module states; none for an engine that is not there.
std::span<const EngineDeviation> deviations(const std::string& engine);
const EngineDeviation* find_deviation(const std::string& engine, std::string_view scene, std::string_view quantity);

}  // namespace duet::conformance
