// duet publish: the rows of a run for others to build tables from.
#include <fmt/format.h>

#include "duet/app/cli/run_notes.h"
#include "duet/app/command.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/execution/run_inputs.h"
#include "duet/experiment/suite/suite.h"
#include "duet/rows/folder/run_directory.h"

namespace duet::cli {
namespace {

struct PublishArguments {
  std::string run, folder;
  bool partial = false, without_clips = false;
};

// The suite.yaml as it stands in the published folder: networks and other files that the run does not keep are named
// from there. The engines' settings stand behind it, for people.
std::string suite_from_there(const std::string& run, const std::string& folder) {
  const std::string path = run + "/suite.yaml", text = read_text(path);
  std::string moved = resolved_yaml(rebased(parse_run_suite(text, path), run, folder));
  if (const std::size_t settings = text.find("\n# "); settings != std::string::npos) moved += text.substr(settings + 1);
  return moved;
}

void run_publish(Session& session, const PublishArguments& arguments) {
  require_whole(open_run(arguments.run), arguments.run, arguments.partial, "publish");
  PublishedInputs inputs = published_inputs(arguments.run, arguments.without_clips);
  if (has_inputs(arguments.run)) inputs.texts["suite.yaml"] = suite_from_there(arguments.run, arguments.folder);
  publish_run(arguments.run, arguments.folder, inputs);
  const Run run = load_run(arguments.folder);
  const std::vector<std::string> notes = completeness_notes({arguments.folder}, {run});
  print(session,
        with_notes("md",
                   fmt::format("{}: {} rows of {} {}; `duet report {}` builds its tables", arguments.folder,
                               run.rows.size(), run.info.suite, run.info.suite_version, shell_word(arguments.folder)),
                   notes),
        {{"published", arguments.folder}, {"rows", run.rows.size()}, {"notes", notes}});
}

}  // namespace

void add_publish(CLI::App& app, Session& session) {
  CLI::App* command = add_command(
      app, session, "publish",
      "freeze the rows of a run for others: without traces, with a manifest that `duet report` and all others check",
      "duet publish runs/policies -o results/published/policies");
  auto arguments = std::make_shared<PublishArguments>();
  command->add_option("run", arguments->run, "run directory")->required();
  command->add_option("-o,--output", arguments->folder, "folder to make")->required();
  command->add_flag("--partial", arguments->partial, "also a run that lacks episodes that were asked for");
  command->add_flag(
      "--without-clips", arguments->without_clips,
      "leave out the clips, of recordings that may not be passed on: their SHA-256 stand in the index, and "
      "who has them gives `duet verify --clips DIR`");
  command->callback([&session, arguments] { run_publish(session, *arguments); });
}

}  // namespace duet::cli
