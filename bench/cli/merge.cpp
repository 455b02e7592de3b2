// duet merge: the runs of several people as one.
#include "duet/bench/merge.h"

#include <fmt/format.h>

#include "duet/bench/cli/command.h"

namespace duet::cli {
namespace {

struct MergeArguments {
  std::vector<std::string> runs;
  std::string output;
};

void run_merge(Session& session, const MergeArguments& arguments) {
  std::vector<Run> runs;
  for (const std::string& path : arguments.runs) runs.push_back(load_run(path));
  const RunUnion both = unite(runs);
  const bool merged = both.conflicts.empty();
  std::string text;
  for (const std::string& conflict : both.conflicts) text += conflict + "\n";
  if (merged) write_merged(runs, both, session.argv, arguments.output);
  text += merged ? fmt::format("{}: {} episodes of {} runs; {} that more than one had are equal and there once",
                               arguments.output, both.run.rows.size(), runs.size(), both.folded)
                 : fmt::format("{} episodes are not the same in all runs: nothing was written", both.conflicts.size());
  print(session, text,
        {{"merged", merged ? nlohmann::json(arguments.output) : nlohmann::json(nullptr)},
         {"rows", both.run.rows.size()},
         {"folded", both.folded},
         {"conflicts", both.conflicts}});
  if (!merged) session.exit_code = kExitGate;
}

}  // namespace

void add_merge(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "merge",
                                  "one run from several of one suite, each with policies of its own (exit code 1 where "
                                  "they disagree on an episode)",
                                  "duet merge runs/mine runs/yours --output runs/ours");
  auto arguments = std::make_shared<MergeArguments>();
  command->add_option("runs", arguments->runs, "run directories of one suite")->required();
  command->add_option("-o,--output", arguments->output, "run directory to make")->required();
  command->callback([&session, arguments] { run_merge(session, *arguments); });
}

}  // namespace duet::cli
