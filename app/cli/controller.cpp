// duet controller: an IO descriptor from what a network's makers say of it (import), and its audit.
#include <fmt/format.h>

#include <filesystem>

#include "duet/app/cli/controller_audit.h"
#include "duet/app/command.h"
#include "duet/controllers/import/descriptor_import.h"
#include "duet/core/file.h"
#include "duet/core/require.h"

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
