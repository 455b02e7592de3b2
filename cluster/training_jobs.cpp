#include "duet/cluster/training_jobs.h"

#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <system_error>
#include <thread>
#include <utility>

#include "duet/cluster/attempt.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/experiment/suite_file/suite_section.h"
#include "duet/robots/yaml_section.h"

namespace duet {
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
  if (!arms.IsMap() || arms.size() == 0)
    top.fail(top.line("arms"), fmt::format("arms: expected a mapping of names, found {}", describe(arms)));
  for (const auto& arm : arms) {
    const std::string name = arm.first.Scalar();
    if (!is_arm_name(name))
      top.fail(top.line("arms"),
               fmt::format("arms: expected names of letters, digits, '_' and '.', found '{}'", shown(name)));
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
      top.fail(top.line("seeds"), fmt::format("seeds: expected whole numbers of at least 0, found '{}'", shown(text)));
    list.seeds.push_back(seed);
  }
  if (list.seeds.empty()) top.fail(top.line("seeds"), "seeds: expected one at least, found none");
}

// The number that a child ended with, as a shell says it.
int wait_for(pid_t child, const StopSign& stop) {
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
  if (const std::string schema = top.text("schema"); schema != kTrainingsSchema)
    top.fail(top.line("schema"), fmt::format("expected schema {}, found {}", kTrainingsSchema, shown(schema)));
  TrainingList list;
  list.train = top.text("train");
  const std::vector<std::string> known = training_names();
  if (std::ranges::find(known, list.train) == known.end())
    top.fail(top.line("train"), unknown_name_message("training", list.train, known));
  read_arms(top, list);
  read_seeds(top, list);
  list.minutes = top.optional_number("minutes").value_or(list.minutes);
  if (list.minutes <= 0.0 || list.minutes > kMostMinutes)
    top.fail(top.line("minutes"),
             fmt::format("minutes: expected above 0 to {:g}, found {:g}", kMostMinutes, list.minutes));
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
                          const StopSign& stop) {
  const Shard& job = shard_of(plan, shard);
  require_allowed({program_of(job.training, run)}, allow_programs);
  require_same_program(plan.program, program_digests({}), run);
  static_cast<void>(inside(run, "trainings/" + job.name));
  WorkSummary summary;
  summary.planned = 1;
  for (const AttemptRecord& attempt : read_attempts(run, shard))
    if (attempt.end == "complete") summary.already_there = 1;
  if (summary.already_there > 0) return summary;
  AttemptWriter attempt(run, new_attempt(shard, shard_plan_digest(run)));
  attempt.began(job.name);
  const auto begin = StopSign::Clock::now();
  summary.exit_code = wait_for(start_child(run, command_of(job.training)), stop);
  const double seconds = std::chrono::duration<double>(StopSign::Clock::now() - begin).count();
  const std::string how = ending_of(summary.exit_code);
  if (how != "stopped") attempt.did(job.name, how == "complete" ? "ok" : "error", seconds);
  if (how == "stopped") summary.end = summary.exit_code == 130 ? RunEnd::kInterrupted : RunEnd::kTerminated;
  attempt.ended(how);
  summary.run = how == "complete" ? 1 : 0;
  return summary;
}

}  // namespace duet
