#include "duet/cluster/work_shard.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "duet/cluster/attempt.h"
#include "duet/cluster/plan_run.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/execution/runner.h"
#include "duet/experiment/suite_file/suite_key.h"
#include "duet/experiment/work/run_work.h"
#include "duet/robots/yaml_schema.h"
#include "duet/rows/merge/merge_files.h"
#include "duet/rows/row_file.h"

namespace duet {
namespace {

// The rows of all workers of a shard, each read once: workers look at them as they grow.
class ShardRows {
 public:
  ShardRows(const PlannedRun& run, std::int64_t shard) : run_(run), shard_(shard) {}

  // Those that were not there at the last look.
  void look(const std::function<void(const EpisodeRow&)>& each) {
    for (const std::string& path : rows_files(run_.path(), shard_)) {
      Read& read = read_[path];
      LineFile lines(path, read.bytes);
      while (const std::optional<std::string_view> line = lines.next()) {
        each(row_of(*line, path, ++read.lines));
        read.bytes += line->size() + 1;
      }
    }
  }

 private:
  struct Read {
    std::uint64_t bytes = 0;
    int lines = 0;
  };

  [[nodiscard]] EpisodeRow row_of(std::string_view line, const std::string& path, int number) const {
    const std::string& hash = run_.info().suite_hash;
    try {
      EpisodeRow row = scan_row(line).row;
      if (row.suite_hash != hash)
        throw InputError(fmt::format("a row of suite hash {:.12}, expected {:.12}", row.suite_hash, hash));
      return row;
    } catch (const InputError& error) {
      throw InputError(
          fmt::format("{}:{}: {}; remove the file, and its episodes run again", path, number, error.what()));
    }
  }

  const PlannedRun& run_;
  std::int64_t shard_;
  std::map<std::string, Read> read_;  // by path
};

// The history of a shard's earlier attempts, which says what is left to do.
struct ShardHistory {
  std::map<std::string, Outcome> outcomes;                  // by key: of the row that stands
  std::map<std::string, std::vector<std::string>> crashes;  // key -> signals
  std::map<std::string, int> losses;
};

ShardHistory history_of(const PlannedRun& run, std::int64_t shard, ShardRows& rows) {
  ShardHistory history;
  const std::int64_t now = file_system_time(run.path());
  rows.look([&](const EpisodeRow& row) { note_outcome(row.key, row.outcome, history.outcomes); });
  for (const AttemptRecord& attempt : read_attempts(run.path(), shard)) {
    for (const AttemptRecord::Crash& crash : attempt.crashes) history.crashes[crash.key].push_back(crash.signal);
    const bool lost = attempt.end.empty() && attempt.crashes.empty() && !may_be_alive(attempt, now, kSilence);
    for (const std::string& key : attempt.open) history.losses[key] += lost ? 1 : 0;
  }
  return history;
}

// Why no worker is to try again; empty where one is.
std::string poison_of(const std::string& key, const ShardHistory& history) {
  if (const auto crashes = history.crashes.find(key);
      crashes != history.crashes.end() && std::ssize(crashes->second) >= kMostCrashes)
    return fmt::format("killed its worker {} times: {}", crashes->second.size(), fmt::join(crashes->second, ", "));
  if (const auto losses = history.losses.find(key); losses != history.losses.end() && losses->second >= kMostLosses)
    return fmt::format("{} workers were killed while they were at it (SIGKILL, as where memory is short)",
                       losses->second);
  return "";
}

class ShardWorker {
 public:
  ShardWorker(const std::string& path, std::int64_t number, const WorkOptions& options, const StopToken& stop)
      : run_(path, options.allow_programs),
        number_(number),
        shard_(shard_of(run_.plan(), number)),
        options_(options),
        stop_(stop) {
    if (keys_digest(run_.experiment(), shard_.begin, shard_.end) != shard_.keys)
      throw InputError(
          fmt::format("{}/plan.json: shard {}: the keys of its episodes are not those of the plan", path, number));
    history_ = history_of(run_, number, rows_);
    if (run_.experiment().suite().record != RecordTrajectories::kNone)
      trajectories_ = join_without_links(path, "trajectories");
  }

  WorkSummary work(Progress& progress) {
    const std::vector<std::int64_t> places = missing_places();
    if (places.empty()) return std::move(summary_);
    run_.load_clips(places.front(), places.back() + 1);
    AttemptWriter attempt(run_.path(), new_attempt(number_, shard_plan_digest(run_.path())));
    note_crashes_in(attempt.descriptor());
    try {
      roll_out(places, attempt, progress);
    } catch (...) {
      note_crashes_in(-1);
      say_end(attempt, "storage");
      throw;
    }
    note_crashes_in(-1);
    if (summary_.already_there + summary_.run < summary_.planned) summary_.end = stop_.end();
    say_end(attempt, summary_.end == RunEnd::kComplete ? "complete" : "stopped");
    return std::move(summary_);
  }

 private:
  std::vector<std::int64_t> missing_places() {
    std::vector<std::int64_t> places;
    summary_.planned = shard_.episodes();
    for (std::int64_t place = shard_.begin; place < shard_.end; ++place) {
      const std::string key = run_.experiment().row(place).key;
      if (is_there(key))
        ++summary_.already_there;
      else
        places.push_back(place);
    }
    return places;
  }

  // A time-out runs again.
  [[nodiscard]] bool is_there(const std::string& key) const {
    const auto known = history_.outcomes.find(key);
    if (known == history_.outcomes.end()) return false;
    return has_ended(known->second) || (known->second == Outcome::kError && !options_.retry_errors);
  }

  // Whether another worker has made a row of it since this one began.
  bool is_done_by_others(const std::string& key) {
    const std::lock_guard lock(mutex_);
    rows_.look([&](const EpisodeRow& row) { new_.insert(row.key); });
    if (!new_.contains(key)) return false;
    ++summary_.already_there;
    return true;
  }

  void roll_out(const std::vector<std::int64_t>& places, AttemptWriter& attempt, Progress& progress) {
    progress.start(fmt::format("shard {} ({})", number_, shard_.name), static_cast<int>(places.size()), "episodes");
    // Workers of one shard begin at places of their own, and meet where others have been.
    const std::size_t first = std::hash<std::string>()(attempt.journal()) % places.size();
    parallel_for_each(static_cast<int>(places.size()), options_.threads, [&](int i) {
      if (stop_.asked()) return;
      take(places[(first + static_cast<std::size_t>(i)) % places.size()], attempt);
      progress.advance();
    });
    progress.finish();
  }

  void take(std::int64_t place, AttemptWriter& attempt) {
    const std::string key = run_.experiment().row(place).key;
    if (is_done_by_others(key)) return;
    const std::string poison = options_.retry_errors ? "" : poison_of(key, history_);
    if (!poison.empty()) {
      record(ended_row(run_.experiment().row(place), Outcome::kError, poison), attempt, true);
      return;
    }
    attempt.began(key);
    const CrashScope scope(key);
    try {
      record(run_.experiment().run(place, {.stop_asked = [&] { return stop_.asked(); }, .trajectories = trajectories_}),
             attempt, false);
    } catch (const EpisodeInterrupted&) {
      return;  // no row: it runs again
    }
  }

  void record(const EpisodeRow& row, AttemptWriter& attempt, bool poisoned) {
    attempt.append(row);
    const std::lock_guard lock(mutex_);
    ++summary_.run;
    ++summary_.outcomes[std::string(to_string(row.outcome))];
    if (summary_.first_error.empty()) summary_.first_error = error_text(row);
    summary_.poisoned += poisoned ? 1 : 0;
  }

  // A disk that is full takes no last line; all that it says is that the worker was not killed.
  static void say_end(AttemptWriter& attempt, const std::string& how) {
    try {
      attempt.ended(how);
    } catch (const StorageError&) {
      return;
    }
  }

  PlannedRun run_;
  std::int64_t number_;
  Shard shard_;
  WorkOptions options_;
  const StopToken& stop_;
  ShardRows rows_{run_, number_};
  ShardHistory history_;
  std::set<std::string> new_;  // keys of rows that were made since this worker began, by anybody
  std::string trajectories_;
  std::mutex mutex_;
  WorkSummary summary_;
};

}  // namespace

WorkSummary work_shard(const std::string& run, std::int64_t shard, const WorkOptions& options, const StopToken& stop,
                       Progress& progress) {
  const ShardPlan plan = read_shard_plan(run);
  static_cast<void>(shard_of(plan, shard));
  if (plan.kind == ShardPlan::Kind::kTrainings) return work_training(run, plan, shard, options.allow_programs, stop);
  return ShardWorker(run, shard, options, stop).work(progress);
}

namespace {

namespace fs = std::filesystem;

constexpr const char* kTrainingsSchema = "duet.trainings/1";
constexpr std::chrono::milliseconds kChildGlance(50);
constexpr double kMostMinutes = 1.0e5;

std::vector<std::string> texts_of(const YAML::Node& list, const YamlSection& section, const std::string& what) {
  std::vector<std::string> texts;
  if (!list.IsSequence())
    section.fail(section.line(), fmt::format("{}: expected a list, found {}", what, describe(list)));
  for (const YAML::Node& item : list) {
    if (!item.IsScalar())
      section.fail(section.line(), fmt::format("{}: expected texts, found {}", what, describe(item)));
    texts.push_back(item.Scalar());
  }
  return texts;
}

void read_arms(const YamlSection& top, TrainingList& list) {
  std::vector<std::string> common;
  if (top.has("arguments")) common = texts_of(top.node("arguments"), top, "arguments");
  const YAML::Node arms = top.node("arms");
  if (!arms.IsMap() || arms.size() == 0) top.refuse_key("arms", "a mapping of names", arms);
  for (const auto& arm : arms) {
    const std::string name = arm.first.Scalar();
    if (!is_arm_name(name))
      top.fail_key("arms", fmt::format("expected names of letters, digits, '_' and '.', found '{}'", excerpt(name)));
    const std::string what = fmt::format("arm '{}'", name);
    std::vector<std::string> words = common;
    for (std::string& word : texts_of(arm.second, top, what)) words.push_back(std::move(word));
    try {
      list.arms[name] = parse_training_options(list.train, words, what);
    } catch (const InputError& error) {
      top.fail(top.line("arms"), error.what());
    }
  }
}

void read_seeds(const YamlSection& top, TrainingList& list) {
  for (const std::string& text : names_in(top, "seeds")) {
    std::uint64_t seed = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
    if (error != std::errc() || end != text.data() + text.size())
      top.fail_key("seeds", fmt::format("expected whole numbers of at least 0, found '{}'", excerpt(text)));
    list.seeds.push_back(seed);
  }
  if (list.seeds.empty()) top.fail_key("seeds", "expected one at least, found none");
}

// The number that a child ended with, as a shell says it.
int wait_for(pid_t child, const StopToken& stop) {
  bool told = false;
  for (int status = 0;;) {
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child) return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    if (ended < 0 && errno != EINTR) throw InputError("a training's process cannot be waited for");
    if (stop.asked() && !std::exchange(told, true))
      ::kill(child, stop.end() == RunEnd::kInterrupted ? SIGINT : SIGTERM);
    std::this_thread::sleep_for(kChildGlance);
  }
}

pid_t start_child(const std::string& folder, const std::vector<std::string>& arguments) {
  std::string program = fs::read_symlink("/proc/self/exe").string();
  std::vector<std::string> words = arguments;
  words.insert(words.begin(), program);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  pid_t child = -1;
  const int error = posix_spawn(&child, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0)
    throw InputError(fmt::format("cannot start '{}': {}", program, std::generic_category().message(error)));
  return child;
}

std::string ending_of(int code) {
  if (code == 0) return "complete";
  return code == 75 || code == 130 ? "stopped" : "failed";
}

}  // namespace

TrainingList parse_trainings(const std::string& yaml, const std::string& file) {
  const YamlSection top(file, parse_yaml(yaml, file), "trainings",
                        {"schema", "train", "arguments", "arms", "seeds", "minutes"});
  top.require_schema(kTrainingsSchema);
  TrainingList list;
  list.train = top.text("train");
  const std::vector<std::string> known = training_names();
  if (std::ranges::find(known, list.train) == known.end())
    top.fail(top.line("train"), unknown_name_message("training", list.train, known));
  read_arms(top, list);
  read_seeds(top, list);
  read_optional(top, {.name = "minutes", .unit = "min", .range = {0.0, kMostMinutes, false}}, list.minutes);
  return list;
}

ShardPlan plan_trainings(const TrainingList& list, const std::string& directory) {
  std::error_code error;
  if (fs::exists(directory, error) && !fs::is_empty(directory, error))
    throw InputError(fmt::format("'{}' is not empty: choose another folder for the trainings", directory));
  ShardPlan plan;
  plan.kind = ShardPlan::Kind::kTrainings;
  plan.program = program_digests({});
  for (const auto& [arm, options] : list.arms) {
    for (const std::uint64_t seed : list.seeds) {
      const auto place = static_cast<std::int64_t>(plan.shards.size());
      PlannedTraining training{list.train, arm, seed, options};
      plan.shards.push_back({.name = training.name(),
                             .begin = place,
                             .end = place + 1,
                             .cost = 60.0 * list.minutes,
                             .keys = {},
                             .training = std::move(training)});
    }
  }
  plan.episodes = static_cast<std::int64_t>(plan.shards.size());
  write_shard_plan(plan, directory);
  return plan;
}

namespace {

std::vector<std::string> command_of(const PlannedTraining& training) {
  return training_command(training.train, training.options, training.seed, "trainings/" + training.name());
}

NamedProgram program_of(const PlannedTraining& training, const std::string& run) {
  std::vector<std::string> command = command_of(training);
  command.insert(command.begin(), "duet");
  return program_in(fmt::format("training '{}'", training.name()), plan_file(run), command);
}

}  // namespace

std::vector<NamedProgram> programs_of(const ShardPlan& plan, const std::string& run) {
  std::vector<NamedProgram> programs;
  for (const Shard& shard : plan.shards)
    if (!shard.training.train.empty()) programs.push_back(program_of(shard.training, run));
  return programs;
}

WorkSummary work_training(const std::string& run, const ShardPlan& plan, std::int64_t shard, bool allow_programs,
                          const StopToken& stop) {
  const Shard& job = shard_of(plan, shard);
  require_allowed({program_of(job.training, run)}, allow_programs);
  require_same_program(plan.program, program_digests({}), run);
  static_cast<void>(join_without_links(run, "trainings/" + job.name));
  WorkSummary summary;
  summary.planned = 1;
  for (const AttemptRecord& attempt : read_attempts(run, shard))
    if (attempt.end == "complete") summary.already_there = 1;
  if (summary.already_there > 0) return summary;
  AttemptWriter attempt(run, new_attempt(shard, shard_plan_digest(run)));
  attempt.began(job.name);
  const auto begin = StopToken::Clock::now();
  summary.exit_code = wait_for(start_child(run, command_of(job.training)), stop);
  const double seconds = std::chrono::duration<double>(StopToken::Clock::now() - begin).count();
  const std::string how = ending_of(summary.exit_code);
  if (how != "stopped") attempt.did(job.name, how == "complete" ? "ok" : "error", seconds);
  if (how == "stopped") summary.end = summary.exit_code == 130 ? RunEnd::kInterrupted : RunEnd::kTerminated;
  attempt.ended(how);
  summary.run = how == "complete" ? 1 : 0;
  return summary;
}

}  // namespace duet
