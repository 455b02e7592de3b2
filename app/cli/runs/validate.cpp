// duet validate: the conformance suite in every engine, and the parity certificate of it.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>

#include "duet/app/certificate.h"
#include "duet/app/command.h"
#include "duet/backends/engine_module.h"
#include "duet/core/file_batch.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/experiment/suite/profile.h"
#include "duet/report/page/html_page.h"
#include "duet/report/tables/text_table.h"
#include "duet/rows/json_fields.h"

namespace duet::cli {
namespace {

struct ValidateArguments {
  std::vector<std::string> engines, scenes;
  std::string profile = "parity", effort = "quick", card, output;
  bool all = false;
};

std::vector<std::string> chosen_engines(const ValidateArguments& arguments) {
  std::vector<std::string> names = arguments.engines;
  for (const std::string& name : names) static_cast<void>(engine_module(name));
  if (!names.empty()) return names;
  for (const EngineInfo& engine : engines())
    if (engine.available) names.push_back(engine.name);
  if (names.empty()) throw MissingError("no physics engine is there to validate (duet doctor says why)");
  return names;
}

std::vector<std::string> chosen_scenes(const ValidateArguments& arguments) {
  for (const std::string& name : arguments.scenes) static_cast<void>(conformance::find_scene(name));
  if (!arguments.scenes.empty()) return arguments.scenes;
  return names_of(conformance::scenes());
}

std::vector<conformance::EngineReport> run_scenes(const ValidateArguments& arguments, const Profile& profile,
                                                  Progress& progress) {
  const std::vector<std::string> scenes = chosen_scenes(arguments), names = chosen_engines(arguments);
  const auto robot = load_shared_robot(arguments.card);
  std::vector<conformance::EngineReport> reports;
  for (const std::string& name : names) {
    const EngineSettings settings = profile.settings(name);
    conformance::EngineReport report{
        .engine = name,
        .version = engine_module(name).version(),
        .settings = {.dt = settings.dt,
                     .options = settings.options,
                     .law = settings.law,
                     .armature = settings.armature,
                     .effort = arguments.effort == "full" ? conformance::Effort::kFull : conformance::Effort::kQuick,
                     .robot = robot},
        .scenes = {}};
    progress.start("validating " + name, static_cast<int>(scenes.size()), "scenes");
    for (const std::string& scene : scenes) {
      report.scenes.push_back({scene, conformance::run_scene(conformance::find_scene(scene), name, report.settings)});
      progress.advance();
    }
    progress.finish();
    reports.push_back(std::move(report));
  }
  conformance::agree(reports);
  return reports;
}

std::string number_text(const conformance::Measurement& found, double number) {
  return found.unsupported ? "-" : fmt::format("{:.4g}", number);
}

std::string tolerance_text(const conformance::Measurement& found) {
  if (found.unsupported) return "-";
  return found.relative ? fmt::format("{:.2g} %", 100.0 * found.tolerance) : fmt::format("{:.2g}", found.tolerance);
}

// Every check, or only those that did not pass.
std::string engine_table(const CertifiedEngine& engine, bool all) {
  TextTable table{.header = {"scene", "quantity", "verdict", "dt [ms]", "found", "expected", "tolerance", "unit"},
                  .rows = {},
                  .label_columns = 3};
  for (const CertifiedMeasurement& entry : engine.measurements) {
    if (!all && entry.verdict == conformance::CheckStatus::kPass) continue;
    const conformance::Measurement& found = entry.found;
    table.rows.push_back({found.scene, found.quantity, std::string(conformance::to_string(entry.verdict)),
                          fmt::format("{:g}", 1e3 * found.dt), number_text(found, found.value),
                          number_text(found, found.expected), tolerance_text(found), found.unit});
  }
  return table.rows.empty() ? "" : fmt::format("\n{}\n", markdown_table(table));
}

// " (38 hang on the torque law and the armature)": how many of the failed checks are of the law's group.
std::string failed_by_law(const CertifiedEngine& engine) {
  const auto count = std::ranges::count_if(engine.measurements, [](const CertifiedMeasurement& entry) {
    return entry.verdict == conformance::CheckStatus::kFail &&
           conformance::find_scene(entry.found.scene).group == conformance::kLawGroup;
  });
  return count == 0 ? "" : fmt::format(" ({} hang on the torque law and the armature)", count);
}

std::string summary(const CertifiedEngine& engine) {
  const std::string unsupported =
      engine.tally.unsupported > 0 ? fmt::format(", {} unsupported", engine.tally.unsupported) : "";
  return fmt::format("{} {} ({}, {:g} ms): {} passed, {} asserted deviation{}, {} failed{}{}\n", engine.name,
                     engine.version, engine.profile, 1e3 * engine.dt, engine.tally.passed, engine.tally.deviations,
                     engine.tally.deviations == 1 ? "" : "s", engine.tally.failed, failed_by_law(engine), unsupported);
}

// Why checks of an engine are unsupported.
void note_unsupported(Session& session, const std::vector<conformance::EngineReport>& reports) {
  for (const conformance::EngineReport& report : reports)
    if (const int checks = conformance::tally(report).unsupported; checks > 0)
      note(session, fmt::format("{}: {} check{} unsupported: it has no solid partner ({})", report.engine, checks,
                                checks == 1 ? " is" : "s are", engine_module(report.engine).no_solid_partner));
}

// Scenes that the robot lacks something for, each once.
void note_skipped(Session& session, const std::vector<conformance::EngineReport>& reports) {
  for (const conformance::SceneReport& scene : reports.front().scenes)
    if (!scene.run.skipped.empty())
      note(session, fmt::format("scene '{}' is skipped: {}", scene.name, scene.run.skipped));
}

void run_validate(Session& session, const ValidateArguments& arguments) {
  require(arguments.card.empty() || arguments.output.empty(),
          "--output: a certificate is of the robot that stands in, expected it without --card");
  const Profile profile = load_profile(arguments.profile);
  Progress progress(session.progress());
  const std::vector<conformance::EngineReport> reports = run_scenes(arguments, profile, progress);
  const Certificate certificate =
      certify(reports, profile.name, fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr))));
  const nlohmann::json json = certificate_json(certificate);
  std::string text;
  for (const CertifiedEngine& engine : certificate.engines) {
    text += summary(engine) + engine_table(engine, arguments.all);
    if (engine.tally.failed > 0) session.exit_code = kExitDeterminism;
  }
  note_skipped(session, reports);
  note_unsupported(session, reports);
  for (const conformance::EngineReport& report : reports)
    for (const std::string& stale :
         arguments.card.empty() ? conformance::stale_deviations(report) : std::vector<std::string>{})
      note(session, stale);
  if (!arguments.output.empty()) {
    const std::filesystem::path folder = arguments.output;
    std::vector<std::string> notes;
    const ViewerBundle viewer = viewer_or_plain("report", notes);
    for (const std::string& plain : notes) note(session, plain);
    FileBatch batch;
    batch.write(folder / "certificate.json", dumped(json, 1) + "\n");
    batch.write(folder / "parity.html", parity_page(certificate, viewer.style));
    if (const std::string picture = parity_svg(certificate); !picture.empty())
      batch.write(folder / "parity.svg", picture);
    batch.put_in_place();
    note(session, fmt::format("wrote {0}/certificate.json and {0}/parity.html", arguments.output));
  }
  print(session, text, json);
}

}  // namespace

void add_validate(CLI::App& app, Session& session) {
  CLI::App* command = add_command(
      app, session, "validate", "check physics engines against closed forms and one another (exit code 5 if one fails)",
      "duet validate --engine mujoco,ode --effort full -o parity");
  auto arguments = std::make_shared<ValidateArguments>();
  command->add_option("--engine", arguments->engines, "engines; default: all that are there")->delimiter(',');
  command->add_option("--profile", arguments->profile, "engine profile: parity, fast, accurate or a file")
      ->capture_default_str();
  command->add_option("--effort", arguments->effort, "quick, or full: more step sizes and longer runs")
      ->check(CLI::IsMember({"quick", "full"}))
      ->capture_default_str();
  command->add_option("--card", arguments->card, "robot of the scenes, by name or path (default: the G1)");
  command->add_option("--scene", arguments->scenes, "scenes; default: all")->delimiter(',');
  command->add_flag("--all", arguments->all, "print every check, not only those that did not pass");
  command->add_option("-o,--output", arguments->output, "folder for certificate.json and parity.html");
  command->callback([&session, arguments] { run_validate(session, *arguments); });
}

}  // namespace duet::cli
