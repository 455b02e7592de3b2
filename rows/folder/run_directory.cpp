#include "duet/rows/folder/run_directory.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <string_view>
#include <system_error>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "duet/core/require.h"
#include "duet/rows/folder/run_files.h"
#include "duet/rows/folder/run_info.h"
#include "duet/rows/folder/run_rows.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/row_file.h"

namespace duet {
namespace {

// Bytes of the lock file: held to write, and by everybody who works in the folder.
constexpr std::uint64_t kWriting = 0, kPresent = 1;

std::string beside(const std::string& folder, const char* name) {
  return (std::filesystem::path(folder) / name).string();
}

bool is_run(const std::string& folder) { return std::filesystem::exists(beside(folder, "run.json")); }

// The hint "; 'runs/demo/run' is one", where somebody gave the folder of a run's folder.
std::string runs_hint(const std::string& folder) {
  std::vector<std::string> runs;
  std::error_code unreadable;
  for (std::filesystem::directory_iterator entry(folder, unreadable), end; !unreadable && entry != end;
       entry.increment(unreadable))
    if (std::filesystem::exists(entry->path() / "run.json", unreadable)) runs.push_back(entry->path().string());
  std::ranges::sort(runs);
  return runs.empty() ? ""
                      : fmt::format("; '{}' {}", fmt::join(runs, "', '"), runs.size() == 1 ? "is one" : "are some");
}

// A run that was killed before run.json was there leaves only the lock and the half-written file of another name.
bool is_fresh(const std::string& folder) {
  std::error_code error;
  if (!std::filesystem::exists(folder, error)) return true;
  std::filesystem::directory_iterator entries(folder, error);
  if (error) throw InputError(fmt::format("cannot open '{}' as a run directory: {}", folder, error.message()));
  return std::all_of(begin(entries), end(entries), [](const std::filesystem::directory_entry& entry) {
    const std::string name = entry.path().filename().string();
    return name == "lock" || name.starts_with("run.json.");
  });
}

// Refuses a link in the place of anything that this program writes into the folder or reads from it.
void refuse_links(const std::string& folder) {
  for (const char* name :
       {"run.json", "env.json", "suite.yaml", "episodes.jsonl", "resumed.jsonl", "lock", "trajectories", "prepared"})
    static_cast<void>(join_without_links(folder, name));
  require_plain_files(folder);
}

void create_folder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw StorageError(fmt::format("cannot write '{}': {}", folder, error.message()));
}

void require_same_suite(const std::string& folder, const RunInfo& found, const RunInfo& wanted) {
  if (found.suite == wanted.suite && found.suite_version == wanted.suite_version &&
      found.suite_hash == wanted.suite_hash) {
    return;
  }
  throw InputError(fmt::format("'{}' holds a run of suite {}, not of {}: choose another folder", folder,
                               suite_label(found), suite_label(wanted)));
}

// Also where a run was killed between the first file and these.
void write_missing(const std::string& folder, const RunInfo& info) {
  if (const std::string file = join_without_links(folder, "env.json"); !std::filesystem::exists(file))
    write_file(file, dumped(info.environment, 2) + "\n");
  if (const std::string file = join_without_links(folder, "suite.yaml"); !std::filesystem::exists(file))
    write_file(file, info.suite_yaml);
}

void require_same_actors(const std::string& folder, const RunInfo& found, const RunInfo& wanted) {
  IdentityCheck digests;
  digests.add(found, beside(folder, "run.json"));
  try {
    digests.add(wanted, "this machine");
  } catch (const InputError& error) {
    throw InputError(fmt::format("'{}' cannot be resumed: {}; choose another folder", folder, error.what()));
  }
}

// Another machine or another program may go on with a run; who wrote which row is then told by the times.
void record_resumption(const std::string& folder, const RunInfo& info) {
  nlohmann::json json = {{"at", info.created_at}, {"argv", info.argv}, {"environment", info.environment}};
  if (!info.certificate.is_null()) json["certificate"] = info.certificate;
  LineAppender(join_without_links(folder, "resumed.jsonl")).append(dumped(json));
}

}  // namespace

RunDirectory RunDirectory::open(const std::string& path, const RunInfo& info, bool retry_errors,
                                const std::vector<std::string>& replaced) {
  if (is_published(path))
    throw InputError(fmt::format("'{}' is published: its rows stay as they are; choose another folder", path));
  // In this order: another process may begin the run in between, and its run.json is there before anything else.
  if (!is_fresh(path) && !is_run(path))
    throw InputError(fmt::format("'{}' is not empty and holds no run (no run.json): choose another folder", path));
  create_folder(path);
  refuse_links(path);
  RunDirectory run;
  run.path_ = path;
  run.retry_errors_ = retry_errors;
  run.lock_ = std::make_unique<FolderLock>(join_without_links(path, "lock"));
  const ScopedLock writing(*run.lock_, kWriting);
  const bool resumed = is_run(path);
  if (!resumed) write_file(join_without_links(path, "run.json"), run_json(info));
  RunInfo found = read_run_json(beside(path, "run.json"));
  require_same_suite(path, found, info);
  const bool alone = run.lock_->try_lock(kPresent);
  run.replace(found, info, replaced, alone);
  require_same_actors(path, found, info);
  if (alone) remove_litter(path);
  run.lock_->lock(kPresent, FolderLock::Kind::kShared);
  write_missing(path, info);
  run.read_rows(info);
  if (resumed) record_resumption(path, info);
  return run;
}

// Under the lock. run.json comes last: where the process ends before, the same call begins anew.
void RunDirectory::replace(RunInfo& found, const RunInfo& wanted, const std::vector<std::string>& policies,
                           bool alone) {
  std::vector<std::string> others;
  for (const std::string& name : policies) {
    const auto there = found.policies.find(name);
    const auto now = wanted.policies.find(name);
    if (there == found.policies.end() || now == wanted.policies.end() || there->second == now->second) continue;
    others.push_back(name);
    there->second = now->second;
  }
  if (others.empty()) return;
  if (!alone)
    throw InputError(fmt::format("'{}': rows of {} cannot be replaced while another run works in the folder", path_,
                                 fmt::join(others, ", ")));
  const std::string file = join_without_links(path_, "episodes.jsonl");
  std::string kept;
  std::vector<std::string> keys;
  const std::string text = std::filesystem::exists(file) ? read_text(file) : "";
  for (std::size_t begin = 0, end = 0; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
    const EpisodeRow row = row_from_json(parse_json(text.substr(begin, end - begin), file));
    if (std::ranges::find(others, row.policy) == others.end())
      kept.append(text, begin, end + 1 - begin);
    else
      keys.push_back(row.key);
  }
  write_file(file, kept);
  for (const std::string& key : keys) {
    const std::string name = key.substr(0, 16);
    if (name.find_first_not_of("0123456789abcdef") == std::string::npos)
      std::filesystem::remove(join_without_links(path_, "trajectories") + "/" + name + ".npz");
  }
  write_file(join_without_links(path_, "run.json"), run_json(found));
}

// Under the lock: what others append later is read from here on.
void RunDirectory::read_rows(const RunInfo& info) {
  const std::string file = join_without_links(path_, "episodes.jsonl");
  // Opening cuts an incomplete last line off, so that what is read after it is what the file holds.
  lines_ = std::make_unique<LineAppender>(file);
  suite_hash_ = info.suite_hash;
  const RunRows rows = read_run_rows(file, info);
  for (const EpisodeRow& row : rows.rows()) keys_[row.key] = {row.outcome, true};
}

// Reads the rows that other processes have appended.
void RunDirectory::read_appended(bool cut) {
  const std::string text = lines_->read_appended(cut);
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find('\n', begin);
    const nlohmann::json json = parse_json(std::string_view(text).substr(begin, end - begin),
                                           beside(path_, "episodes.jsonl") + ": a row of another process");
    const EpisodeRow row = row_from_json(json);
    const auto [known, is_new] = keys_.try_emplace(row.key);
    const bool stands = is_new || which_stands(known->second.outcome, row.outcome) != Stands::kFirst;
    known->second = {stands ? row.outcome : known->second.outcome, false};
    begin = end + 1;
  }
}

bool RunDirectory::has(const std::string& key) const {
  const auto known = keys_.find(key);
  return known != keys_.end() && !may_run_again(known->second);
}

Claim RunDirectory::claim(const std::string& key) {
  if (has(key)) return Claim::kDone;
  if (!lock_->try_lock(lock_place(key))) return Claim::kTaken;
  read_appended(false);
  if (!has(key)) return Claim::kMine;
  release(key);
  return Claim::kDone;
}

void RunDirectory::release(const std::string& key) { lock_->unlock(lock_place(key)); }

bool RunDirectory::append(const EpisodeRow& row) {
  require(!row.key.empty(), "an episode row without a key");
  require(row.suite_hash == suite_hash_, "a row of suite hash {} does not belong in '{}' (suite hash {})",
          row.suite_hash, path_, suite_hash_);
  const ScopedLock writing(*lock_, kWriting);
  read_appended(true);
  const bool first = !has(row.key);
  if (first) lines_->append(dumped(duet::to_json(row)));
  if (first) keys_[row.key] = {row.outcome, false};
  release(row.key);
  return first;
}

void RunDirectory::ask_for(const EpisodeFilter& part, std::int64_t episodes,
                           const std::function<std::int64_t(const std::vector<EpisodeFilter>&)>& count) {
  const ScopedLock writing(*lock_, kWriting);
  RunInfo info = read_run_json(beside(path_, "run.json"));
  RunPlan plan;
  plan.parts = with_part(info.plan ? info.plan->parts : std::vector<EpisodeFilter>(), part);
  plan.episodes = episodes;
  plan.asked = count(plan.parts);
  if (info.plan == plan) return;
  info.plan = std::move(plan);
  write_file(join_without_links(path_, "run.json"), run_json(info));
}

bool RunDirectory::is_finished() {
  const ScopedLock writing(*lock_, kWriting);
  read_appended(true);
  const RunInfo info = read_run_json(beside(path_, "run.json"));
  return info.plan && std::cmp_greater_equal(keys_.size(), info.plan->asked);
}

Run load_run_head(const std::string& path) {
  if (!is_run(path))
    throw InputError(fmt::format("'{}' is not a run directory (no run.json){}", path, runs_hint(path)));
  require_plain_files(path);
  check_published(path);
  Run run;
  run.path = path;
  run.info = read_run_json(beside(path, "run.json"));
  const std::string environment = beside(path, "env.json");
  run.info.environment = parse_json(read_text(environment), environment);
  run.info.suite_file = beside(path, "suite.yaml");
  run.info.suite_yaml = read_text(run.info.suite_file);
  return run;
}

Run load_run(const std::string& path, RowExtent extent) {
  Run run = load_run_head(path);
  bool torn = false;
  const std::string file = beside(path, "episodes.jsonl");
  if (extent == RowExtent::kLean && std::filesystem::exists(file)) run.file = RowFile(file);
  RunRows rows = read_run_rows(file, run.info, &torn, extent);
  run.dropped_lines = torn ? 1 : 0;
  if (rows.equal() > 0)
    run.warnings.push_back(
        fmt::format("'{}': {} rows are there twice and equal; each counts once", path, rows.equal()));
  run.rows = rows.take();
  return run;
}

bool is_partial(const Run& run) { return run.info.plan && std::cmp_less(run.rows.size(), run.info.plan->asked); }

std::string completeness(const Run& run) {
  if (!run.info.plan || std::cmp_greater_equal(run.rows.size(), run.info.plan->episodes)) return "";
  const RunPlan& plan = *run.info.plan;
  const std::string of = fmt::format("{} of {} episodes", run.rows.size(), plan.episodes);
  if (!is_partial(run)) return of + ": the part that was asked for";
  return plan.asked == plan.episodes ? of + ": partial" : fmt::format("{}, {} were asked for: partial", of, plan.asked);
}

namespace {

namespace fs = std::filesystem;

constexpr const char* kRows = "episodes.jsonl";
constexpr std::array kFiles = {"run.json", "env.json", "suite.yaml", "resumed.jsonl"};  // where they are

std::string in(const std::string& folder, const std::string& name) { return (fs::path(folder) / name).string(); }

std::string lean_rows(const Run& run) {
  std::string text;
  for (EpisodeRow row : run.rows) {
    for (const RowField& field : row_fields())
      if (field.use.heavy) field.clear(row);
    text += dumped(to_json(row)) + "\n";
  }
  return text;
}

// A run names files by their places on its machine, alone or in lists and settings; what is published names them from
// the folder that it is published from.
std::string without_places(const std::string& text) {
  static const std::regex place("([\"':=,\\[])(/[^/\"':,\\]][^\"':,\\]]*)");
  std::string result;
  auto rest = text.begin();
  for (std::sregex_iterator at(text.begin(), text.end(), place), end; at != end; ++at) {
    result.append(rest, (*at)[2].first)
        .append(fs::path((*at)[2].str()).lexically_proximate(fs::current_path()).string());
    rest = (*at)[2].second;
  }
  return result.append(rest, text.end());
}

nlohmann::json description_of(const Run& run) {
  nlohmann::json without = nlohmann::json::array();
  for (const RowField& field : row_fields())
    if (field.use.heavy) without.push_back(field.name);
  return {{"suite", run.info.suite},
          {"suite_version", run.info.suite_version},
          {"suite_hash", run.info.suite_hash},
          {"rows", run.rows.size()},
          {"without", without}};
}

void copy_inputs(const std::string& source, const std::string& folder, const PublishedInputs& inputs) {
  for (const std::string& name : inputs.files) {
    require_plain_file(source, name);
    fs::create_directories(fs::path(in(folder, name)).parent_path());
    fs::copy_file(in(source, name), in(folder, name));
  }
  for (const auto& [name, text] : inputs.texts) write_file(in(folder, name), text);
}

void fill(const std::string& folder, const std::string& source, const Run& run, const PublishedInputs& inputs) {
  write_file(in(folder, kRows), lean_rows(run));
  for (const char* name : kFiles)
    if (fs::exists(in(source, name))) write_file(in(folder, name), without_places(read_file(in(source, name))));
  copy_inputs(source, folder, inputs);
  write_manifest(folder, description_of(run));
}

}  // namespace

void publish_run(const std::string& run, const std::string& folder, const PublishedInputs& inputs) {
  if (fs::exists(folder))
    throw InputError(fmt::format("'{}' is there already: what is published stays; choose another folder", folder));
  const Run loaded = load_run(run);
  if (loaded.rows.empty()) throw InputError(fmt::format("'{}' has no rows to publish", run));
  const ScratchFolder scratch = ScratchFolder::beside(folder);
  fill(scratch / "run", run, loaded, inputs);
  scratch.publish("run", folder);
}

}  // namespace duet
