// duet merge: the runs of several people as one, or what many machines have done of a planned one.
#include "duet/cluster/merge.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "duet/parts/cluster/part.h"

namespace duet::cli {
namespace {

struct MergeArguments {
  std::vector<std::string> runs;
  MergeOptions options;
};

constexpr std::size_t kMostGaps = 20;  // that are printed

std::string gaps_text(const MergeSummary& summary) {
  if (summary.planned == 0) return "";
  if (summary.gaps.empty()) return fmt::format("; all {} planned episodes are there", summary.planned);
  std::int64_t missing = 0;
  for (const ShardGap& gap : summary.gaps) missing += gap.episodes - gap.rows;
  std::string text = fmt::format("; {} of {} planned episodes are missing, of {} shards:\n", missing, summary.planned,
                                 summary.gaps.size());
  for (std::size_t i = 0; i < std::min(summary.gaps.size(), kMostGaps); ++i) {
    const ShardGap& gap = summary.gaps[i];
    text += fmt::format("  {}: shard {}: {} of {} episodes\n", gap.run, gap.shard, gap.rows, gap.episodes);
  }
  if (summary.gaps.size() > kMostGaps) text += fmt::format("  and {} shards more\n", summary.gaps.size() - kMostGaps);
  return text;
}

std::string nodes_text(const MergedRows& rows) {
  std::string text;
  for (const auto& [node, count] : rows.of_node) text += fmt::format("{}: {} rows\n", node, count);
  for (const auto& [pair, agreement] : rows.agreement)
    text += fmt::format("{} and {}: {} episodes that both ran, {} differ\n", pair.first, pair.second,
                        agreement.compared, agreement.different);
  return text;
}

std::string text_of(const MergeSummary& summary, const MergeArguments& arguments) {
  const MergedRows& rows = summary.rows;
  std::string text;
  for (const std::string& conflict : rows.conflicts) text += conflict + "\n";
  if (rows.violations > std::ssize(rows.conflicts))
    text += fmt::format("and {} episodes more\n", rows.violations - std::ssize(rows.conflicts));
  text += nodes_text(rows);
  if (!summary.written)
    return text + fmt::format("{} episodes are not the same in all runs: nothing was written", rows.violations);
  const std::string& to = arguments.options.output.empty() ? arguments.runs.front() : arguments.options.output;
  text += fmt::format("{}: {} episodes of {} runs; {} that more than one had are equal and there once", to, rows.rows,
                      arguments.runs.size(), rows.folded);
  if (rows.superseded > 0) text += fmt::format("; {} errors and time-outs gave way to another row", rows.superseded);
  if (rows.errors > 0) text += fmt::format("; {} ended with an error", rows.errors);
  if (rows.timeouts > 0) text += fmt::format("; {} timed out", rows.timeouts);
  if (rows.torn > 0) text += fmt::format("; {} last lines were not whole and are left out", rows.torn);
  return text + gaps_text(summary);
}

nlohmann::json json_of(const MergeSummary& summary, const MergeArguments& arguments) {
  const MergedRows& rows = summary.rows;
  const std::string& to = arguments.options.output.empty() ? arguments.runs.front() : arguments.options.output;
  nlohmann::json gaps = nlohmann::json::array(), pairs = nlohmann::json::array();
  for (const ShardGap& gap : summary.gaps)
    gaps.push_back({{"run", gap.run}, {"shard", gap.shard}, {"rows", gap.rows}, {"episodes", gap.episodes}});
  for (const auto& [pair, agreement] : rows.agreement)
    pairs.push_back(
        {{"nodes", {pair.first, pair.second}}, {"compared", agreement.compared}, {"different", agreement.different}});
  return {{"merged", summary.written ? nlohmann::json(to) : nlohmann::json(nullptr)},
          {"rows", rows.rows},
          {"folded", rows.folded},
          {"superseded", rows.superseded},
          {"errors", rows.errors},
          {"timeouts", rows.timeouts},
          {"torn", rows.torn},
          {"planned", summary.planned},
          {"missing", gaps},
          {"nodes", rows.of_node},
          {"pairs", pairs},
          {"violations", rows.violations},
          {"conflicts", rows.conflicts}};
}

void run_merge(Session& session, MergeArguments arguments) {
  arguments.options.argv = session.argv;
  const MergeSummary summary = merge_runs(arguments.runs, arguments.options);
  print(session, text_of(summary, arguments), json_of(summary, arguments));
  if (!summary.written) session.exit_code = kExitGate;
}

}  // namespace

void add_merge(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "merge",
                  "one run from several of one suite, each with policies of its own, or from the workers of a planned "
                  "one (exit code 1 where they disagree on an episode)",
                  "duet merge runs/mine runs/yours --output runs/ours\n"
                  "  duet merge runs/planned");
  auto arguments = std::make_shared<MergeArguments>();
  command->add_option("runs", arguments->runs, "run directories of one suite")->required();
  command->add_option("-o,--output", arguments->options.output,
                      "run directory to make (default: into the one run, which was planned)");
  command->add_option("--without-node", arguments->options.without_nodes,
                      "leave the rows of this node out (repeatable): one whose rows are not those of the others");
  command->callback([&session, arguments] { run_merge(session, *arguments); });
}

}  // namespace duet::cli
