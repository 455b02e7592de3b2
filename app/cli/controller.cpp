// duet controller: an IO descriptor from what a network's makers say of it (import), and its audit.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "duet/app/command.h"
#include "duet/controllers/audit/trace.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/descriptor_controller.h"
#include "duet/controllers/import/descriptor_import.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/actuation_limits.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/report/tables/text_table.h"
#include "duet/robots/robot_cards.h"
#include "duet/rollout/audit/controller_audit.h"

namespace duet::cli {
namespace {

void run_import(Session& session, ImportRequest request, const std::string& output) {
  namespace fs = std::filesystem;
  if (!output.empty()) {
    request.folder = fs::absolute(output).parent_path().string();
    if (request.name.empty()) request.name = fs::path(output).stem().string();
  }
  const ImportedDescriptor made = import_descriptor(request);
  if (!output.empty()) write_file(output, made.text);
  for (const std::string& sentence : made.assumed) note(session, "assumed: " + sentence);
  for (const std::string& sentence : made.found) note(session, "found: " + sentence);
  const std::string said = fmt::format("{}: a descriptor of {} on '{}', from a file of {}; {} assumptions\n", output,
                                       made.name, made.robot, made.kind, made.assumed.size());
  print(session, output.empty() ? made.text : said,
        {{"kind", made.kind},
         {"name", made.name},
         {"robot", made.robot},
         {"network", made.network},
         {"descriptor", made.text},
         {"assumed", made.assumed},
         {"found", made.found}});
  if (!output.empty())
    suggest_next(session, fmt::format("duet run walk -s controllers=[{}] -o runs/{}", output, made.name));
}

// duet controller audit: whether a descriptor says of a network what its makers meant, and what it says wrong.

struct AuditArguments {
  std::string controller, network, urdf, trace, engine = "mujoco", format = "text";
};

// A descriptor with its network, its robot and the trace to hold it against.
struct LoadedSubject {
  AuditSubject subject;
  NetworkFile network;
  std::string path;
  std::optional<ControllerTrace> trace;
};

LoadedSubject load_subject(const AuditArguments& arguments) {
  LoadedSubject loaded;
  AuditSubject& subject = loaded.subject;
  subject.descriptor = load_descriptor(arguments.controller);
  const ControllerOptions options =
      arguments.network.empty() ? ControllerOptions{} : ControllerOptions{{"network", arguments.network}};
  loaded.path = find_network(subject.descriptor, options);
  loaded.network = load_networks(subject.descriptor, options);
  subject.robot =
      arguments.urdf.empty()
          ? load_shared_robot(card_path(subject.descriptor.robot))
          : std::make_shared<const RobotModel>(load_robot(card_path(subject.descriptor.robot), arguments.urdf));
  subject.make = controllers_of_network(subject.robot, loaded.network.make, loaded.path);
  subject.physics = trial_physics(subject.descriptor, loaded.network.metadata, *subject.robot);
  // Refuses other sizes and unusable answers before anything else is done.
  require_usable(*subject.make(subject.descriptor, {}), *subject.robot, subject.descriptor.name);
  if (!arguments.trace.empty())
    loaded.trace = read_controller_trace(arguments.trace, subject.descriptor, *subject.robot);
  return loaded;
}

// L0: it is loaded by now; what its file says of itself.
void add_level_0(const LoadedSubject& loaded, ControllerAudit& audit) {
  const Descriptor& descriptor = loaded.subject.descriptor;
  std::vector<AuditCheck> checks = {
      {0, "loads",
       fmt::format("{} numbers in, {} out, on {}", descriptor.input_size(descriptor.observation.inputs[0]),
                   descriptor.actions(), loaded.subject.robot->name),
       ""}};
  const AuditSubject& subject = loaded.subject;
  const JointGains gains = standing_gains(*subject.make(descriptor, {}), *subject.robot);
  checks.push_back({0, "explicit law holds up to", to_text(actuation_limits(subject.robot, gains)), ""});
  std::vector<std::string> notes;
  try {
    notes = compare_with_network(descriptor, loaded.network.metadata, loaded.path);
  } catch (const InputError& error) {
    notes = {error.what()};
    audit.defects.insert(audit.defects.begin(),
                         {ContractPart::kJointOrder, "the joints in the order of its file", 0, 0.0});
  }
  if (loaded.network.metadata.empty())
    checks.push_back({0, "agrees with its file", "the file says nothing of itself", ""});
  else if (notes.empty())
    checks.push_back({0, "agrees with its file", "yes", "yes"});
  for (const std::string& note : notes) checks.push_back({0, "agrees with its file", note, "yes", false});
  audit.checks.insert(audit.checks.begin(), checks.begin(), checks.end());
}

// L3: the trace, and the reading that gives the trace where the descriptor does not.
void add_level_3(const LoadedSubject& loaded, ControllerAudit& audit) {
  if (!loaded.trace) return audit.checks.push_back({3, "equals a trace", "no trace is given (--trace)", ""});
  const AuditSubject& subject = loaded.subject;
  const auto compare = [&](const Descriptor& descriptor) {
    return compare_with_trace(descriptor, subject.robot, loaded.network.make, loaded.path, *loaded.trace);
  };
  const TraceAgreement own = compare(subject.descriptor);
  const double most = std::max({own.observation, own.action, own.target});
  audit.checks.push_back({3, fmt::format("equals {} rows of a trace", loaded.trace->rows()),
                          own.equal ? fmt::format("to {:.1e}", most) : own.first,
                          fmt::format("to {:.0e}", kTraceTolerance), own.equal});
  if (own.equal) return;
  constexpr std::size_t kMostPatterns = 8;
  for (std::size_t i = 0; i < std::min(own.patterns.size(), kMostPatterns); ++i)
    audit.checks.push_back({3, "differs from the trace", own.patterns[i], "", false});
  if (own.patterns.size() > kMostPatterns)
    audit.checks.push_back({3, "differs from the trace",
                            fmt::format("and {} numbers more", own.patterns.size() - kMostPatterns), "", false});
  std::vector<NamedDefect> equal;
  for (const Reading& reading : other_readings(subject.descriptor, *subject.robot))
    if (reading.part != ContractPart::kGains && compare(reading.descriptor).equal)
      equal.push_back({reading.part, fmt::format("{}: with that it gives the trace", reading.said), reading.line, 0.0});
  if (!equal.empty()) audit.defects = std::move(equal);
}

// "ok", "no", or "" where nothing was asked.
const char* verdict_of(const AuditCheck& check) {
  if (!check.good) return "no";
  return check.asked.empty() ? "" : "ok";
}

TitledTable table_of(const ControllerAudit& audit, const std::string& name) {
  TitledTable titled{.title = fmt::format("Audit of {}", name)};
  titled.table.header = {"level", "check", "found", "asked", ""};
  titled.table.label_columns = 5;
  for (const AuditCheck& check : audit.checks)
    titled.table.rows.push_back(
        {fmt::format("L{}", check.level), check.what, check.found, check.asked, verdict_of(check)});
  return titled;
}

std::vector<std::string> sentences_of(const ControllerAudit& audit, const Descriptor& descriptor) {
  std::vector<std::string> lines;
  for (const NamedDefect& defect : audit.defects)
    lines.push_back(fmt::format("{}{}: {}: the network expects {}", descriptor.file,
                                defect.line > 0 ? fmt::format(":{}", defect.line) : "", to_string(defect.part),
                                defect.said));
  lines.push_back(audit.verdict);
  return lines;
}

std::string text_of(const ControllerAudit& audit, const Descriptor& descriptor) {
  std::string text;
  for (const AuditCheck& check : audit.checks)
    text += fmt::format("  L{} {:<3} {:<32} {}{}\n", check.level, verdict_of(check), check.what, check.found,
                        check.asked.empty() ? "" : fmt::format(" (asked: {})", check.asked));
  for (const std::string& line : sentences_of(audit, descriptor)) text += line + "\n";
  return text;
}

std::string markdown_text(const ControllerAudit& audit, const Descriptor& descriptor) {
  TitledTable titled = table_of(audit, descriptor.name);
  titled.notes = sentences_of(audit, descriptor);
  return markdown_of(titled);
}

nlohmann::json json_of(const ControllerAudit& audit, const LoadedSubject& loaded) {
  nlohmann::json checks = nlohmann::json::array(), defects = nlohmann::json::array();
  for (const AuditCheck& check : audit.checks)
    checks.push_back({{"level", check.level},
                      {"check", check.what},
                      {"found", check.found},
                      {"asked", check.asked},
                      {"good", check.good}});
  for (const NamedDefect& defect : audit.defects)
    defects.push_back({{"part", to_string(defect.part)}, {"expects", defect.said}, {"line", defect.line}});
  return {{"controller", loaded.subject.descriptor.name},
          {"descriptor", loaded.subject.descriptor.file},
          {"network", loaded.path},
          {"robot", loaded.subject.robot->name},
          {"checks", checks},
          {"defects", defects},
          {"readings", audit.readings},
          {"verdict", audit.verdict}};
}

void run_audit(Session& session, const AuditArguments& arguments) {
  const LoadedSubject loaded = load_subject(arguments);
  ControllerAudit audit = audit_controller(loaded.subject, arguments.engine);
  add_level_0(loaded, audit);
  add_level_3(loaded, audit);
  if (!audit.defects.empty())
    audit.verdict = "The contract is wrong: the descriptor does not say what the network was made for.";
  const Descriptor& descriptor = loaded.subject.descriptor;
  print(session, arguments.format == "md" ? markdown_text(audit, descriptor) : text_of(audit, descriptor),
        json_of(audit, loaded));
  if (!audit.defects.empty()) session.exit_code = kExitGate;
}

void add_controller_audit(CLI::App& controller, Session& session) {
  CLI::App* command = add_command(controller, session, "audit",
                                  "hold a descriptor against its network: alone, in physics and against a recorded "
                                  "trace, and name what it says wrong (exit code 1)",
                                  "duet controller audit mine.yaml --trace recorded.csv");
  auto arguments = std::make_shared<AuditArguments>();
  command->add_option("controller", arguments->controller, "IO descriptor (YAML), or the name of one that ships")
      ->required();
  command->add_option("--network", arguments->network, "path of the network's file");
  command->add_option("--urdf", arguments->urdf, "description of the robot in place of the card's");
  command->add_option("--trace", arguments->trace,
                      "CSV or NPZ file of what the makers' own program sensed and answered");
  command->add_option("--engine", arguments->engine, "engine of the trials")->capture_default_str();
  command->add_option("--format", arguments->format, "text or md")
      ->check(CLI::IsMember({"text", "md"}))
      ->capture_default_str();
  command->callback([&session, arguments] { run_audit(session, *arguments); });
}

}  // namespace

void add_controller_import(CLI::App& app, Session& session) {
  CLI::App* controller = app.add_subcommand("controller", "one controller, from its makers' file to its descriptor");
  controller->require_subcommand(1);
  add_controller_audit(*controller, session);
  CLI::App* command = add_command(
      *controller, session, "import",
      "write an IO descriptor from the metadata of an ONNX file (holosoma, BeyondMimic, mjlab) or from the YAML file "
      "of a "
      "deployment (unitree_rl_lab, mjlab, rl_sar, unitree_rl_gym); what it assumes stands on standard error",
      "duet controller import policy.onnx -o mine.yaml");
  auto request = std::make_shared<ImportRequest>();
  auto output = std::make_shared<std::string>();
  command->add_option("file", request->file, "ONNX file with metadata, or YAML file of a deployment")->required();
  command->add_option("--network", request->network, "network of the YAML file (default: the one beside it)");
  command->add_option("--robot", request->robot, "robot card by name or path (default: the one with its joints)");
  command->add_option("--name", request->name, "name of the controller (default: the file's)");
  command->add_option(
      "--history", request->history,
      "order of a history where the file does not say: frames (frame by frame) or terms (term by term)");
  command->add_option("-o,--output", *output, "file of the descriptor (default: standard output)");
  command->callback([&session, request, output] { run_import(session, *request, *output); });
}

}  // namespace duet::cli
