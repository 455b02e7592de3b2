#include "duet/bench/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "duet/bench/run_inputs.h"
#include "duet/bench/suite_names.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/results/json_fields.h"

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

  [[nodiscard]] const KeptSuite& kept() const { return kept_; }

 private:
  void add(const Run& run) {
    const Suite suite = rebased(parse_suite(run.info.suite_yaml, in(run.path, "suite.yaml")), run.path, folder_);
    const std::vector<RunInput> inputs = read_inputs(run.path);
    const bool first = kept_.suite.name.empty();
    if (first) kept_.suite = suite;
    for (const RunInput& input : inputs)
      if (first || is_of_new_policy(input)) add(input, run.path);
    for (const SuitePolicy& policy : suite.policies)
      if (!has_policy(policy.name)) kept_.suite.policies.push_back(policy);
    for (const std::string& engine : suite.engines)
      if (std::ranges::find(kept_.suite.engines, engine) == kept_.suite.engines.end())
        kept_.suite.engines.push_back(engine);
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
    if (input.kept) kept_.copies.push_back({in(from, input.file), input.file});
  }

  std::string folder_;
  KeptSuite kept_;
};

std::string lines_of(const std::vector<EpisodeRow>& rows) {
  std::string text;
  for (const EpisodeRow& row : rows) text += dumped(to_json(row)) + "\n";
  return text;
}

// Who resumed which of the runs, each line once.
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

void fill(const std::string& folder, const Merger& merger, const std::vector<Run>& runs, const RunUnion& both,
          const std::vector<std::string>& argv) {
  RunInfo info = both.run.info;
  info.suite_yaml = resolved_yaml(merger.kept().suite);
  info.argv = argv;
  static_cast<void>(RunDirectory::open(folder, info));
  write_file(in(folder, "episodes.jsonl"), lines_of(both.run.rows));
  keep_inputs(merger.kept(), folder);
  if (const std::string resumptions = resumptions_of(runs); !resumptions.empty())
    write_file(in(folder, "resumed.jsonl"), resumptions);
}

}  // namespace

void write_merged(const std::vector<Run>& runs, const RunUnion& both, const std::vector<std::string>& argv,
                  const std::string& folder) {
  require(both.conflicts.empty(), "a union with conflicts is not written");
  if (fs::exists(folder))
    throw InputError(fmt::format("'{}' is there already: choose another folder for the merged run", folder));
  const std::string partial = fs::path(folder).lexically_normal().string() + ".partial";
  fs::remove_all(partial);
  try {
    fill(partial, Merger(runs, folder), runs, both, argv);
    fs::rename(partial, folder);
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(partial, ignored);
    throw;
  }
}

}  // namespace duet
