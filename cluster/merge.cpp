#include "duet/cluster/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "duet/cluster/attempt.h"
#include "duet/cluster/shard_plan.h"
#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "duet/core/require.h"
#include "duet/execution/run_inputs.h"
#include "duet/experiment/suite/suite.h"
#include "duet/rows/folder/run_files.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/merge/row_merge.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

std::string in(const std::string& folder, const std::string& file) { return (fs::path(folder) / file).string(); }

// The suite of the first run with the policies and engines of all, and what they were made from.
class Merger {
 public:
  Merger(const std::vector<Run>& runs, std::string folder) : folder_(std::move(folder)) {
    for (const Run& run : runs) add(run);
    std::ranges::sort(kept_.suite.policies, {}, &SuitePolicy::name);
    std::ranges::sort(kept_.suite.engines);
  }

  [[nodiscard]] const ArchivedSuite& kept() const { return kept_; }

  // Episodes of the united suite, where all runs have its engines and each of their arms has as many.
  [[nodiscard]] std::optional<std::int64_t> episodes() const {
    if (!of_each_arm_) return std::nullopt;
    return *of_each_arm_ * arms(kept_.suite);
  }

 private:
  void add(const Run& run) {
    const Suite suite = rebased(parse_run_suite(run.info.suite_yaml, in(run.path, "suite.yaml")), run.path, folder_);
    const std::vector<RunInput> inputs = read_inputs(run.path);
    const bool first = kept_.suite.name.empty();
    if (first) kept_.suite = suite;
    count(run.info.plan, suite, first);
    for (const RunInput& input : inputs)
      if (first || is_of_new_policy(input)) add(input, run.path);
    for (const SuitePolicy& policy : suite.policies)
      if (!has_policy(policy.name)) kept_.suite.policies.push_back(policy);
    for (const std::string& engine : suite.engines)
      if (std::ranges::find(kept_.suite.engines, engine) == kept_.suite.engines.end())
        kept_.suite.engines.push_back(engine);
  }

  static std::int64_t arms(const Suite& suite) {
    const auto policies =
        std::ranges::count_if(suite.policies, [](const auto& one) { return one.name != kNullPolicy; });
    return policies + static_cast<std::int64_t>(suite.controls.size()) + (suite.null_arm ? 1 : 0);
  }

  void count(const std::optional<RunPlan>& plan, const Suite& suite, bool first) {
    const std::int64_t own = arms(suite);
    std::optional<std::int64_t> each;
    if (plan && own > 0 && plan->episodes % own == 0) each = plan->episodes / own;
    const bool same = std::set(suite.engines.begin(), suite.engines.end()) ==
                      std::set(kept_.suite.engines.begin(), kept_.suite.engines.end());
    if (first)
      of_each_arm_ = each;
    else if (!same || each != of_each_arm_)
      of_each_arm_.reset();
  }

  [[nodiscard]] bool has_policy(const std::string& name) const {
    return std::ranges::find(kept_.suite.policies, name, &SuitePolicy::name) != kept_.suite.policies.end();
  }

  [[nodiscard]] bool is_of_new_policy(const RunInput& input) const {
    constexpr std::string_view kPolicy = "policy ";
    return input.of.starts_with(kPolicy) && !has_policy(input.of.substr(kPolicy.size()));
  }

  void add(const RunInput& input, const std::string& from) {
    kept_.inputs.push_back(input);
    if (input.kept) kept_.copies.push_back({in(from, input.file), input.file, input.sha256});
  }

  std::string folder_;
  ArchivedSuite kept_;
  std::optional<std::int64_t> of_each_arm_;
};

// The lines that say who resumed which of the runs, each line once.
std::string resumptions_of(const std::vector<Run>& runs) {
  std::set<std::string> lines;
  for (const Run& run : runs) {
    const std::string path = in(run.path, "resumed.jsonl");
    if (!fs::exists(path)) continue;
    const std::string text = read_file(path);
    for (std::size_t begin = 0, end = 0; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1)
      lines.insert(text.substr(begin, end - begin));
  }
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

// A node that made rows; its environment is the first that it began with.
struct Node {
  nlohmann::json environment;
  std::int64_t attempts = 0;
};

// Everything that a merge reads.
class MergeInputs {
 public:
  MergeInputs(const std::vector<std::string>& paths, const std::vector<std::string>& without) {
    for (const std::string& path : paths) {
      runs_.push_back(load_run_head(path));
      const int number = static_cast<int>(runs_.size()) - 1;
      sources_.push_back({.path = in(path, "episodes.jsonl"), .from = path, .run = number, .shard = -1, .node = {}});
      if (has_shard_plan(path)) add_attempts(path, number, without);
    }
    for (const std::string& node : without)
      require(left_out_.contains(node), "--without-node: no node '{}' has made rows", node);
  }

  [[nodiscard]] const std::vector<Run>& runs() const { return runs_; }
  [[nodiscard]] const std::vector<RowSource>& sources() const { return sources_; }
  [[nodiscard]] const std::map<std::string, Node>& nodes() const { return nodes_; }

  // Shards are numbered through all planned runs.
  void say_gaps(MergeSummary& summary) const {
    for (const PlannedShards& run : planned_) {
      summary.planned += run.plan.episodes;
      for (std::size_t i = 0; i < run.plan.shards.size(); ++i) {
        const auto found = summary.rows.of_shard.find(run.first + static_cast<int>(i));
        const std::int64_t rows = found == summary.rows.of_shard.end() ? 0 : found->second;
        if (rows < run.plan.shards[i].episodes())
          summary.gaps.push_back({run.path, static_cast<std::int64_t>(i), rows, run.plan.shards[i].episodes()});
      }
    }
  }

  // Adds to the runs one for each node, with the environment of the machine that made the rows.
  [[nodiscard]] std::vector<Run> runs_of_nodes() const {
    std::vector<Run> runs = runs_;
    for (const auto& [name, node] : nodes_) {
      runs.push_back(runs.front());
      runs.back().info.environment = node.environment;
    }
    return runs;
  }

 private:
  struct PlannedShards {
    std::string path;
    int first = 0;
    ShardPlan plan;
  };

  void add_attempts(const std::string& path, int number, const std::vector<std::string>& without) {
    PlannedShards planned{path, shards_, read_shard_plan(path)};
    if (planned.plan.kind != ShardPlan::Kind::kEpisodes)
      throw InputError(fmt::format("'{}' is a plan of trainings, which have no rows", path));
    const std::string digest = shard_plan_digest(path);
    for (const std::int64_t shard : attempted_shards(path))
      for (const AttemptRecord& attempt : read_attempts(path, shard)) add(attempt, path, number, without, digest);
    shards_ += static_cast<int>(planned.plan.shards.size());
    planned_.push_back(std::move(planned));
  }

  void add(const AttemptRecord& attempt, const std::string& path, int number, const std::vector<std::string>& without,
           const std::string& digest) {
    const AttemptHeader& header = attempt.header;
    if (!header.plan.empty() && header.plan != digest)
      throw InputError(fmt::format("{}: the attempt is at another plan ({:.12}) than that of '{}' ({:.12})",
                                   attempt.journal, header.plan, path, digest));
    if (std::ranges::find(without, header.node) != without.end()) {
      left_out_.insert(header.node);
      return;
    }
    if (!header.node.empty()) {
      Node& node = nodes_[header.node];
      if (node.environment.is_null()) node.environment = header.environment;
      ++node.attempts;
    }
    const std::string from =
        header.node.empty() ? attempt.rows_file : fmt::format("{} on {}", attempt.rows_file, header.node);
    sources_.push_back({.path = attempt.rows_file,
                        .from = from,
                        .run = number,
                        .shard = shards_ + static_cast<int>(header.shard),
                        .node = header.node});
  }

  std::vector<Run> runs_;
  std::vector<RowSource> sources_;
  std::map<std::string, Node> nodes_;
  std::vector<PlannedShards> planned_;
  std::set<std::string> left_out_;
  int shards_ = 0;
};

std::vector<std::int64_t> rows_of_each(const std::vector<Run>& runs, const MergedRows& rows) {
  std::vector<std::int64_t> counts;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const auto found = rows.of_run.find(static_cast<int>(i));
    counts.push_back(found == rows.of_run.end() ? 0 : found->second);
  }
  return counts;
}

// Writes all files of the result but the rows.
void fill(const std::string& folder, const std::string& partial, const MergeInputs& inputs, const MergedRows& rows,
          const std::vector<std::string>& argv) {
  const std::vector<Run>& runs = inputs.runs();
  RunInfo info = united_info(runs, rows_of_each(runs, rows), rows.rows);
  info.environment = united_environment(inputs.runs_of_nodes());
  const Merger merger(runs, folder);
  info.suite_yaml = resolved_yaml(merger.kept().suite);
  if (const std::optional<std::int64_t> episodes = merger.episodes(); episodes && info.plan) {
    if (rows.rows == *episodes) info.plan->asked = rows.rows;  // what one lacks another has
    info.plan->episodes = std::max(*episodes, info.plan->asked);
    if (info.plan->asked == info.plan->episodes) info.plan->parts = {EpisodeFilter()};
  }
  info.argv = argv;
  static_cast<void>(RunDirectory::open(partial, info));
  keep_inputs(merger.kept(), partial);
  if (const std::string resumptions = resumptions_of(runs); !resumptions.empty())
    write_file(in(partial, "resumed.jsonl"), resumptions);
}

void merge_to_folder(const MergeInputs& inputs, const MergeOptions& options, MergeSummary& summary) {
  const std::string& folder = options.output;
  if (fs::exists(folder))
    throw InputError(fmt::format("'{}' is there already: choose another folder for the merged run", folder));
  const ScratchFolder scratch = ScratchFolder::beside(folder);
  const std::string partial = scratch / "run", rows = scratch / "rows";
  summary.rows = merge_rows(inputs.sources(), inputs.runs().front().info, rows, options.budget);
  summary.written = summary.rows.violations == 0;
  if (!summary.written) return;
  fill(folder, partial, inputs, summary.rows, options.argv);
  fs::rename(rows, in(partial, "episodes.jsonl"));
  scratch.publish("run", folder);
}

std::string text_at(const nlohmann::json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  return object.is_object() && found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

// The host as a factor: which node made how many rows on what, and which nodes' rows were compared.
nlohmann::json hosts_json(const MergeInputs& inputs, const MergedRows& rows) {
  nlohmann::json nodes = nlohmann::json::array(), pairs = nlohmann::json::array();
  for (const auto& [name, node] : inputs.nodes()) {
    const auto made = rows.of_node.find(name);
    nodes.push_back({{"node", name},
                     {"machine", text_at(node.environment, "machine")},
                     {"attempts", node.attempts},
                     {"rows", made == rows.of_node.end() ? 0 : made->second},
                     {"environment", node.environment}});
  }
  for (const auto& [pair, agreement] : rows.agreement)
    pairs.push_back(
        {{"nodes", {pair.first, pair.second}}, {"compared", agreement.compared}, {"different", agreement.different}});
  return {{"schema", "duet.hosts/1"}, {"nodes", nodes}, {"pairs", pairs}};
}

constexpr std::uint64_t kMerging = 2;  // byte of the run's lock file (rows/folder/run_directory.cpp)

void merge_in_place(const std::string& run, const MergeOptions& options, MergeSummary& summary) {
  FolderLock lock(join_without_links(run, "lock"));
  const ScopedLock merging(lock, kMerging);
  const MergeInputs inputs({run}, options.without_nodes);
  summary.rows = merge_rows(inputs.sources(), inputs.runs().front().info, join_without_links(run, "episodes.jsonl"),
                            options.budget);
  summary.written = summary.rows.violations == 0;
  inputs.say_gaps(summary);
  write_file(join_without_links(run, "hosts.json"), dumped(hosts_json(inputs, summary.rows), 1) + "\n");
}

}  // namespace

MergeSummary merge_runs(const std::vector<std::string>& runs, const MergeOptions& options) {
  MergeSummary summary;
  require(!runs.empty(), "expected a run at least, found none");
  if (options.output.empty()) {
    if (runs.size() != 1)
      throw InputError("--output is needed where several runs are merged: the run directory to make");
    static_cast<void>(read_shard_plan(runs.front()));
    merge_in_place(runs.front(), options, summary);
    return summary;
  }
  const MergeInputs inputs(runs, options.without_nodes);
  static_cast<void>(united_info(inputs.runs(), std::vector<std::int64_t>(runs.size(), 0), 0));  // of one suite
  merge_to_folder(inputs, options, summary);
  inputs.say_gaps(summary);
  return summary;
}

}  // namespace duet
