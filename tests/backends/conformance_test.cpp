// Every engine that is there runs every scene of the conformance suite at quick effort: ctest -R Conformance.
#include "duet/backends/conformance/conformance.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <sstream>

#include "duet/backends/conformance/trial.h"
#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/robots/robot_cards.h"
#include "tests/support.h"

namespace duet::conformance {
namespace {

using Case = std::tuple<std::string, std::string>;  // engine, scene

std::vector<std::string> physics_engines() {
  std::vector<std::string> names;
  for (const EngineInfo& engine : engines()) names.push_back(engine.name);
  return names;
}

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const ConformanceScene& scene : scenes()) names.emplace_back(scene.name);
  return names;
}

std::string absence(const std::string& engine) {
  for (const EngineInfo& info : engines())
    if (info.name == engine && !info.available) return fmt::format("engine {} absent: {}", engine, info.reason);
  return "";
}

std::string sentence(const std::string& engine, const Measurement& found) {
  return fmt::format("{}: {}: {} = {:.6g} {}, expected {:.6g}, {} error {:.3g} of {:.3g} allowed at dt {} ms ({})",
                     engine, found.scene, found.quantity, found.value, found.unit, found.expected,
                     found.relative ? "relative" : "absolute", error_of(found), found.tolerance, 1e3 * found.dt,
                     found.note);
}

// An engine that is here and misses a tolerance, and where.
struct Known {
  std::string engine;
  EngineDeviation deviation;
};
std::optional<Known> a_known_deviation() {
  for (const EngineInfo& info : engines())
    if (const auto known = deviations(info.name); !known.empty()) return Known{info.name, known.front()};
  return std::nullopt;
}

class Conformance : public ::testing::TestWithParam<Case> {};

TEST_P(Conformance, Holds) {
  const auto& [engine, scene] = GetParam();
  if (const std::string reason = absence(engine); !reason.empty()) GTEST_SKIP() << "not run: " << reason;
  const EngineReport report = run_suite(engine, {}, std::vector{scene});
  for (const Measurement& found : report.scenes[0].run.measurements)
    if (status_of(engine, found) == CheckStatus::kFail) ADD_FAILURE() << sentence(engine, found);
  EXPECT_FALSE(report.scenes[0].run.measurements.empty());
  for (const std::string& stale : stale_deviations(report)) ADD_FAILURE() << stale;
}

std::string case_name(const ::testing::TestParamInfo<Case>& info) {
  std::string name = std::get<0>(info.param) + "_" + std::get<1>(info.param);
  std::replace_if(
      name.begin(), name.end(), [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Engines, Conformance,
                         ::testing::Combine(::testing::ValuesIn(physics_engines()), ::testing::ValuesIn(scene_names())),
                         case_name);

// Torques set from the state, in a world that knows no armature: what is wrong with it is one thing.
TEST(ConformanceGroup, OfTheLawHoldsAllThatAnotherLawFails) {
  for (const std::string& engine : physics_engines()) {
    if (!absence(engine).empty()) continue;
    Settings bare;
    bare.law = TorqueLaw::kExplicit;
    bare.armature = 0.0;
    const EngineReport report = run_suite(engine, bare);
    int failed = 0;
    for (const SceneReport& scene : report.scenes)
      for (const Measurement& found : scene.run.measurements) {
        if (status_of(engine, found) != CheckStatus::kFail) continue;
        ++failed;
        EXPECT_EQ(find_scene(found.scene).group, kLawGroup) << sentence(engine, found);
      }
    EXPECT_GT(failed, 0) << engine;
    break;  // the others differ in contact alone, which Conformance holds
  }
}

Measurement measured(double value, double expected, double tolerance) {
  return {.scene = "stand",
          .quantity = "ground force",
          .unit = "N",
          .dt = 0.002,
          .value = value,
          .expected = expected,
          .tolerance = tolerance,
          .relative = false,
          .across_engines = false,
          .note = ""};
}

EngineReport report_of(const std::string& engine, std::vector<Measurement> measurements) {
  EngineReport report;
  report.engine = engine;
  report.scenes.push_back(
      {measurements[0].scene,
       {.measurements = std::move(measurements), .skipped = "", .error = "", .error_unit = "", .accuracy = {}}});
  return report;
}

TEST(ConformanceVerdict, IsByAbsoluteOrRelativeErrorAndFailsForNaN) {
  Measurement found = measured(101.0, 100.0, 1.0);
  EXPECT_EQ(status_of("ode", found), CheckStatus::kPass);
  found.value = 101.1;
  EXPECT_EQ(status_of("ode", found), CheckStatus::kFail);
  found.relative = true;
  found.tolerance = 0.02;
  EXPECT_EQ(status_of("ode", found), CheckStatus::kPass);
  found.expected = -100.0;
  EXPECT_EQ(status_of("ode", found), CheckStatus::kFail);
  found.value = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(status_of("ode", found), CheckStatus::kFail);
}

TEST(ConformanceVerdict, KnownDeviationHoldsUpToItsBoundForItsEngineOnly) {
  const std::optional<Known> here = a_known_deviation();
  if (!here) GTEST_SKIP() << "not run: an engine with a known deviation is absent";
  const EngineDeviation& known = here->deviation;
  Measurement found = measured(0.99 * known.bound, 0.0, 0.0);
  found.scene = known.scene;
  found.quantity = known.quantity;
  EXPECT_EQ(status_of(here->engine, found), CheckStatus::kDeviation);
  EXPECT_EQ(status_of("another", found), CheckStatus::kFail);
  found.value = 1.01 * known.bound;
  EXPECT_EQ(status_of(here->engine, found), CheckStatus::kFail);
}

TEST(ConformanceVerdict, DeviationThatIsGoneIsStale) {
  const std::optional<Known> here = a_known_deviation();
  if (!here) GTEST_SKIP() << "not run: an engine with a known deviation is absent";
  const EngineDeviation& known = here->deviation;
  Measurement found = measured(0.99 * known.bound, 0.0, 0.0);
  found.scene = known.scene;
  found.quantity = known.quantity;
  EXPECT_TRUE(stale_deviations(report_of(here->engine, {found})).empty());
  found.value = 0.0;
  const std::vector<std::string> stale = stale_deviations(report_of(here->engine, {found}));
  ASSERT_EQ(stale.size(), 1U);
  EXPECT_NE(stale[0].find("remove the entry"), std::string::npos);
  found.quantity = "something else";
  ASSERT_EQ(stale_deviations(report_of(here->engine, {found})).size(), 1U);
  EngineReport other_step = report_of(here->engine, {found});
  other_step.settings.dt = 0.001;
  EXPECT_TRUE(stale_deviations(other_step).empty());
}

TEST(ConformanceVerdict, AcrossEnginesTheMedianIsExpectedWhereTwoOrMoreRan) {
  const auto across = [](double value) {
    Measurement found = measured(value, 7.0, 0.1);
    found.across_engines = true;
    return found;
  };
  std::vector<EngineReport> alone = {report_of("a", {across(1.0)})};
  agree(alone);
  EXPECT_EQ(alone[0].scenes[0].run.measurements[0].expected, 7.0);
  std::vector<EngineReport> three = {report_of("a", {across(1.0)}),
                                     report_of("b", {across(1.05), measured(3.0, 4.0, 0.1)}),
                                     report_of("c", {across(1.2)})};
  agree(three);
  EXPECT_EQ(three[2].scenes[0].run.measurements[0].expected, 1.05);
  EXPECT_EQ(three[1].scenes[0].run.measurements[1].expected, 4.0);
  EXPECT_EQ(tally(three[0]).passed, 1);
  EXPECT_EQ(tally(three[2]).failed, 1);
}

TEST(ConformanceSuite, RefusesUnknownScenesAndAbsentEngines) {
  EXPECT_NE(test::thrown_message<std::invalid_argument>([] { find_scene("pendulun"); }).find("did you mean 'pendulum'"),
            std::string::npos);
  EXPECT_NE(test::thrown_message<std::invalid_argument>([] { run_suite("mujocco", {}); }).find("unknown engine"),
            std::string::npos);
}

TEST(ConformanceSuite, FaultOfAnEngineIsAFailedMeasurementWithItsMessage) {
  for (const EngineInfo& info : engines()) {
    if (!info.available) continue;
    const SceneRun run = run_scene(find_scene("armature"), info.name,
                                   {.dt = 0.5, .options = {}, .effort = Effort::kQuick, .robot = nullptr});
    ASSERT_EQ(run.measurements.size(), 1U);
    EXPECT_EQ(run.measurements[0].quantity, "ran to its end");
    EXPECT_EQ(status_of(info.name, run.measurements[0]), CheckStatus::kFail);
    EXPECT_NE(run.measurements[0].note.find("dt is 0.5 s"), std::string::npos);
  }
}

TEST(ConformanceSuite, ASceneThatTheRobotLacksSomethingForIsSkippedWithTheReason) {
  RobotModel robot = *load_shared_robot();
  robot.name = "stick";
  robot.roles = {};
  for (RobotShape& shape : robot.shapes) shape.region = "arm";
  const Settings settings{
      .dt = 0.002, .options = {}, .effort = Effort::kQuick, .robot = std::make_shared<const RobotModel>(robot)};
  const auto reason = [&](const char* scene) {
    for (const EngineInfo& info : engines())
      if (info.available) {
        const SceneRun run = run_scene(find_scene(scene), info.name, settings);
        EXPECT_TRUE(run.measurements.empty());
        return run.skipped;
      }
    return std::string("not run");
  };
  const auto skips = [&](const char* scene, const std::string& why) {
    const std::string found = reason(scene);
    EXPECT_TRUE(found == "not run" || found == why) << scene << ": " << found;
  };
  skips("self-collision", "the card of robot 'stick' has no pose 'hand_before_trunk'");
  skips("stand", "the card of robot 'stick' has no 'legs' of two or more joints");
  skips("held-push", "the card of robot 'stick' has no shape of the region 'torso'");
}

// The last two joints of its legs are knee and ankle: feedback of an ankle's pitch and roll would bend the knee.
TEST(ConformanceSuite, ARobotWithOneAnkleJointIsNotBalancedByItsKnees) {
  EXPECT_EQ(lacks_ankles(*load_shared_robot(shipped_card("h1"))),
            "a leg of robot 'h1' ends in 'left_knee_joint' and 'left_ankle_joint', expected an ankle's pitch and roll");
  for (const char* card : {"g1", "t1", "h1_2", "xbot_l", "agibot_x1"})
    EXPECT_EQ(lacks_ankles(*load_shared_robot(shipped_card(card))), "") << card;
}

// Bounds of the table were found on the robot that stands in.
TEST(ConformanceSuite, ADeviationOfAnotherRobotHasNoBound) {
  if (const std::string reason = absence("ode"); !reason.empty()) GTEST_SKIP() << "not run: " << reason;
  Measurement found;
  found.scene = "acceleration";
  found.quantity = "error of the acceleration, relative";
  found.value = 1.2;
  found.tolerance = 1e-6;
  EXPECT_EQ(status_of("ode", found), CheckStatus::kFail);
  found.of_stand_in = false;
  EXPECT_EQ(status_of("ode", found), CheckStatus::kDeviation);
  EXPECT_EQ(status_of("mujoco", found), CheckStatus::kFail);
  found.value = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(status_of("ode", found), CheckStatus::kFail);
}

TEST(ConformanceSuite, AnEngineThatIsNotThereHasNoKnownDeviations) {
  EXPECT_TRUE(deviations("another").empty());
  EXPECT_EQ(find_deviation("another", "incline", "acceleration of sliding"), nullptr);
}

TEST(ConformanceSuite, DeviationsNameScenesOfTheSuiteAndGiveAReason) {
  for (const EngineInfo& info : engines())
    for (const EngineDeviation& entry : deviations(info.name)) {
      EXPECT_NO_THROW(find_scene(entry.scene));
      EXPECT_GT(entry.reason.size(), 40U) << info.name << " " << entry.scene;
      EXPECT_GT(entry.bound, 0.0);
    }
}

// Figures that the engines are compared by with one another, each against the median of those that are here.
TEST(ConformanceSuite, EnginesAgreeOnFallAndHeldPush) {
  std::vector<EngineReport> reports;
  for (const EngineInfo& info : engines())
    if (info.available) reports.push_back(run_suite(info.name, {}, std::vector<std::string>{"fall", "held-push"}));
  if (reports.size() < 2) GTEST_SKIP() << "not run: fewer than two physics engines";
  agree(reports);
  for (const EngineReport& report : reports)
    for (const SceneReport& scene : report.scenes)
      for (const Measurement& found : scene.run.measurements)
        if (status_of(report.engine, found) == CheckStatus::kFail) ADD_FAILURE() << sentence(report.engine, found);
}

// The questions of the suite, line by line: nothing is asked less, and no closed form gives another figure.
TEST(ConformanceSuite, AsksWhatItAsked) {
  if (const std::string reason = absence("mujoco"); !reason.empty()) GTEST_SKIP() << "not run: " << reason;
  std::vector<std::string> asked;
  for (const SceneReport& scene : run_suite("mujoco", {}).scenes)
    for (const Measurement& m : scene.run.measurements)
      if (!m.across_engines)
        asked.push_back(
            fmt::format("{} | {} | {:g} | {:.3g} | {:.4g}", m.scene, m.quantity, m.dt, m.tolerance, m.expected));
  std::vector<std::string> record;
  std::istringstream lines(read_file(DUET_SOURCE_DIR "/tests/backends/conformance_record.txt"));
  for (std::string line; std::getline(lines, line);)
    if (!line.starts_with('#')) record.push_back(line);
  EXPECT_EQ(asked, record);
}

}  // namespace
}  // namespace duet::conformance
