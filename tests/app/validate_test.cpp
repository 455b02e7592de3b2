// The parity certificate: what is written is read back, what was edited is refused; `duet validate` as a user meets it.
#include <gmock/gmock.h>

#include <limits>

#include "duet/app/certificate.h"
#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/app/program.h"
#include "tests/deep_json.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

conformance::EngineReport report_of(const std::string& engine, double value) {
  conformance::SceneReport scene;
  scene.name = "pendulum";
  const auto add = [&scene](const std::string& quantity, double found, double tolerance) {
    conformance::Measurement measurement;
    measurement.scene = scene.name;
    measurement.quantity = quantity;
    measurement.unit = "s";
    measurement.dt = 0.002;
    measurement.value = found;
    measurement.expected = 2.0;
    measurement.tolerance = tolerance;
    measurement.note = "an <integral>";
    scene.run.measurements.push_back(measurement);
  };
  add("period", value, 0.1);
  add("nothing", std::numeric_limits<double>::quiet_NaN(), 0.1);
  scene.run.error = "error of the period";
  scene.run.error_unit = "s";
  scene.run.accuracy = {{.dt = 0.002, .error = 1e-3, .cost = 0.02}, {.dt = 0.001, .error = 5e-4, .cost = 0.04}};
  conformance::EngineReport report;
  report.engine = engine;
  report.version = "1.2";
  report.settings.options = {{"iterations", "20"}};
  report.scenes = {scene};
  return report;
}

Certificate example() {
  const std::vector<conformance::EngineReport> reports = {report_of("ode", 2.01), report_of("dart", 2.5)};
  return certify(reports, "parity", "2026-01-02T03:04:05Z");
}

struct CertificateFile : ::testing::Test {
  std::string write(const nlohmann::json& json) {
    write_file(path, json.dump());
    return path;
  }
  std::string refusal(const nlohmann::json& json) {
    write(json);
    return test::thrown_message<InputError>([&] { load_certificate(path); });
  }
  test::ScratchFolder folder;
  std::string path = folder / "certificate.json";
  nlohmann::json json = certificate_json(example());
};

TEST_F(CertificateFile, IsReadBackAsItWasWritten) {
  const Certificate read = load_certificate(write(json));
  EXPECT_EQ(certificate_json(read), json);
  ASSERT_EQ(read.engines.size(), 2U);
  EXPECT_EQ(read.engines[0].tally.passed, 1);
  EXPECT_EQ(read.engines[0].tally.failed, 1);  // the value that is no number
  EXPECT_EQ(read.engines[1].tally.failed, 2);
  EXPECT_EQ(read.engines[0].options.at("iterations"), "20");
  ASSERT_FALSE(read.deviations.empty());
  EXPECT_EQ(read.deviations[0].engine, "ode");
}

TEST_F(CertificateFile, DigestLeavesOutTimeAndCostAlone) {
  json["created_at"] = "2030-01-01T00:00:00Z";
  json["engines"][0]["accuracy"][0]["points"][0]["cost"] = 7.0;
  EXPECT_NO_THROW(load_certificate(write(json)));
  json["engines"][0]["accuracy"][0]["points"][0]["error"] = 7.0;
  EXPECT_THAT(refusal(json), HasSubstr("it was edited after `duet validate` wrote it"));
}

TEST_F(CertificateFile, EditedByHandIsRefused) {
  nlohmann::json edited = json;
  edited["engines"][0]["measurements"][0]["value"] = 2.0;
  EXPECT_THAT(refusal(edited), HasSubstr("its digest is"));
  edited = json;
  edited["machine"] = "a better one";
  EXPECT_THAT(refusal(edited), HasSubstr("edited"));
  edited = json;
  edited["engines"][1]["failed"] = 0;
  EXPECT_THAT(refusal(edited), HasSubstr("says 0 passed, 0 failed, 0 deviations, 0 unsupported; its measurements are "
                                         "0, 2, 0, 0"));
}

TEST_F(CertificateFile, FaultsAreOneSentenceWithTheirPlace) {
  EXPECT_THAT(refusal({{"schema", "duet.certificate/9"}}),
              HasSubstr("expected schema duet.certificate/1, found duet.certificate/9"));
  nlohmann::json broken = json;
  broken.erase("machine");
  EXPECT_THAT(refusal(broken), HasSubstr("expected the key 'machine', found none"));
  broken = json;
  broken["engines"][1]["measurements"][0].erase("dt");
  EXPECT_THAT(refusal(broken), HasSubstr("engines[1]: measurements[0]: expected the key 'dt', found none"));
  broken = json;
  broken["engines"] = 3;
  EXPECT_THAT(refusal(broken), HasSubstr("key 'engines': expected a list, found 3"));
  broken = json;
  broken["engines"][0]["measurements"][0]["verdict"] = "fine";
  EXPECT_THAT(refusal(broken),
              HasSubstr("key 'verdict': unknown verdict 'fine'. Known: pass, FAIL, deviation, unsupported"));
  broken = json;
  broken["engines"][0]["options"] = nlohmann::json::array();
  EXPECT_THAT(refusal(broken), HasSubstr("key 'options': expected a mapping"));
  broken = json;
  broken["signed_by"] = "me";
  EXPECT_THAT(refusal(broken), HasSubstr("signed_by"));
  write_file(path, "{");
  EXPECT_THAT(test::thrown_message<InputError>([&] { load_certificate(path); }), HasSubstr("not valid JSON"));
  write_file(path, "{\"schema\":" + test::deep_json() + "}");
  EXPECT_THAT(test::thrown_message<InputError>([&] { load_certificate(path); }), HasSubstr(test::kTooDeep));
  EXPECT_THAT(test::thrown_message<InputError>([&] { load_certificate(folder / "none.json"); }),
              HasSubstr("cannot read"));
}

TEST(ParityPage, StandsAloneAndShowsEveryMeasurement) {
  const std::string page = parity_page(example(), "/* style */");
  for (const char* outside : {"http://", "https://", "<script", "url("}) EXPECT_THAT(page, Not(HasSubstr(outside)));
  EXPECT_THAT(page, HasSubstr("an &lt;integral&gt;"));
  EXPECT_THAT(page, HasSubstr("<svg class=\"plot\""));
  EXPECT_THAT(page, HasSubstr("ode, 2 ms: 0.001 s at 0.02 CPU s/s"));
  EXPECT_THAT(page, HasSubstr("<td class=\"over\">FAIL</td>"));
  EXPECT_THAT(page, HasSubstr("/* style */"));
}

TEST(ParityPage, PlotsOnlyWhatALogarithmHas) {
  std::vector<CertifiedEngine> engines = example().engines;
  EXPECT_EQ(accuracy_plot_svg(engines, "no such scene"), "");
  for (CertifiedEngine& engine : engines) engine.accuracy[0].points = {{.dt = 0.002, .error = 0.0, .cost = 0.02}};
  EXPECT_EQ(accuracy_plot_svg(engines, "pendulum"), "");
  engines[0].accuracy[0].points = {{.dt = 0.002, .error = 1e-3, .cost = 0.01}};
  const std::string one = accuracy_plot_svg(engines, "pendulum");
  EXPECT_THAT(one, HasSubstr("<circle"));
  EXPECT_THAT(one, Not(HasSubstr("nan")));
  EXPECT_THAT(one, Not(HasSubstr("inf")));
}

test::Answer validate(const std::string& arguments) { return test::duet_program("validate " + arguments); }

std::string any_engine() {
  for (const EngineInfo& engine : engines())
    if (engine.available) return engine.name;
  return "";
}

TEST(ParityPicture, HasAPanelForEachOfItsScenesThatRan) {
  const std::string engine = any_engine();
  if (engine.empty()) GTEST_SKIP() << "not run: no physics engine is there";
  const test::ScratchFolder folder;
  validate("-q --engine " + engine + " --scene chain,saturation,armature -o " + (folder / "parity"));
  const std::string svg = read_file(folder / "parity/parity.svg");
  EXPECT_THAT(svg, HasSubstr(">chain</text>"));
  EXPECT_THAT(svg, HasSubstr(">saturation</text>"));
  EXPECT_THAT(svg, Not(HasSubstr(">free-flight</text>")));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(ValidateCommand, WritesACertificateThatReadsBackAndAPage) {
  const std::string engine = any_engine();
  if (engine.empty()) GTEST_SKIP() << "not run: no physics engine is there";
  const test::ScratchFolder folder;
  const test::Answer answer =
      validate("-q --engine " + engine + " --scene pendulum,armature -o " + (folder / "parity"));
  EXPECT_EQ(answer.code, 0) << answer.out << answer.err;
  EXPECT_THAT(answer.out, Not(HasSubstr("| pendulum")));  // it passes: said in the count
  EXPECT_THAT(validate("-q --all --engine " + engine + " --scene pendulum").out, HasSubstr("| pendulum"));
  EXPECT_THAT(answer.out, HasSubstr("passed, 0 asserted deviations, 0 failed"));
  const Certificate certificate = load_certificate(folder / "parity/certificate.json");
  EXPECT_EQ(certificate.engines[0].name, engine);
  EXPECT_EQ(certificate.engines[0].profile, "parity");
  EXPECT_THAT(read_file(folder / "parity/parity.html"), HasSubstr("largest error of the energy"));
  const test::Answer again = validate("-q --json --engine " + engine + " --scene pendulum,armature");
  EXPECT_EQ(nlohmann::json::parse(again.out).at("digest"), certificate.digest);
}

TEST(ValidateCommand, FailedCheckIsFive) {
  const std::string engine = any_engine();
  if (engine.empty()) GTEST_SKIP() << "not run: no physics engine is there";
  const test::ScratchFolder folder;
  const std::string profile = folder / "coarse.yaml";
  write_file(
      profile,
      "schema: duet.profile/1\nname: coarse\nabout: too coarse for hands on the trunk and for a chain\nengines:\n  " +
          engine + ": {dt: 0.02}\n");
  const test::Answer answer = validate("-q --engine " + engine + " --scene self-collision,chain --profile " + profile);
  EXPECT_EQ(answer.code, 5) << answer.out << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("FAIL"));
}

TEST(ValidateCommand, UnknownNamesAreTwoAndAnAbsentEngineIsFour) {
  EXPECT_EQ(validate("--engine warp9").code, 2);
  EXPECT_EQ(validate("--effort heroic").code, 2);
  const test::Answer scene = validate("--scene pendulun");
  EXPECT_EQ(scene.code, 2);
  EXPECT_THAT(scene.err, HasSubstr("did you mean 'pendulum'"));
  for (const EngineInfo& engine : engines()) {
    if (engine.available) continue;
    EXPECT_EQ(validate("--engine " + engine.name).code, 4) << engine.name;
  }
}

}  // namespace
}  // namespace duet
