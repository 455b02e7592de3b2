#include "duet/bench/cluster/training_jobs.h"

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

#include "duet/bench/cluster/attempt.h"
#include "duet/bench/suite_section.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTrainingsSchema = "duet.trainings/1";
constexpr std::chrono::milliseconds kChildGlance(50);
constexpr double kMostMinutes = 1.0e5;

bool is_plain_word(const std::string& name) {
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.";
  return !name.empty() && name.size() <= 64 && name.front() != '.' &&
         name.find_first_not_of(kLetters) == std::string::npos;
}

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
  const YAML::Node arms = top.node("arms");
  if (!arms.IsMap() || arms.size() == 0)
    top.fail(top.line("arms"), fmt::format("arms: expected a mapping of names, found {}", describe(arms)));
  for (const auto& arm : arms) {
    const std::string name = arm.first.Scalar();
    if (!is_plain_word(name))
      top.fail(top.line("arms"),
               fmt::format("arms: expected names of letters, digits, '_' and '.', found '{}'", shown(name)));
    list.arms[name] = texts_of(arm.second, top, "arm '" + name + "'");
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
  const std::vector<std::string> known = {
      "wbc", "dstar", "dp", "no_phase_attention", "no_spatial_reasoning", "one_stream", "no_language"};
  if (std::ranges::find(known, list.train) == known.end())
    top.fail(top.line("train"), unknown_name_message("training", list.train, known));
  if (top.has("arguments")) list.arguments = texts_of(top.node("arguments"), top, "arguments");
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
  for (const auto& [arm, more] : list.arms) {
    for (const std::uint64_t seed : list.seeds) {
      const auto place = static_cast<std::int64_t>(plan.shards.size());
      Shard shard{.name = fmt::format("{}-{}", arm, seed),
                  .begin = place,
                  .end = place + 1,
                  .cost = 60.0 * list.minutes,
                  .keys = {},
                  .argument = {"train", list.train}};
      shard.argument.insert(shard.argument.end(), list.arguments.begin(), list.arguments.end());
      shard.argument.insert(shard.argument.end(), more.begin(), more.end());
      for (const std::string& word :
           {std::string("--seed"), std::to_string(seed), std::string("-o"), "trainings/" + shard.name})
        shard.argument.push_back(word);
      plan.shards.push_back(std::move(shard));
    }
  }
  plan.episodes = static_cast<std::int64_t>(plan.shards.size());
  write_shard_plan(plan, directory);
  return plan;
}

WorkSummary work_training(const std::string& run, const ShardPlan& plan, std::int64_t shard, const StopSign& stop) {
  require_same_program(plan.program, program_digests({}), run);
  const Shard& job = shard_of(plan, shard);
  WorkSummary summary;
  summary.planned = 1;
  for (const AttemptRecord& attempt : read_attempts(run, shard))
    if (attempt.end == "complete") summary.already_there = 1;
  if (summary.already_there > 0) return summary;
  AttemptWriter attempt(run, new_attempt(shard, shard_plan_digest(run)));
  attempt.began(job.name);
  const auto begin = StopSign::Clock::now();
  summary.exit_code = wait_for(start_child(run, job.argument), stop);
  const double seconds = std::chrono::duration<double>(StopSign::Clock::now() - begin).count();
  const std::string how = ending_of(summary.exit_code);
  if (how != "stopped") attempt.did(job.name, how == "complete" ? "ok" : "error", seconds);
  if (how == "stopped") summary.end = summary.exit_code == 130 ? RunEnd::kInterrupted : RunEnd::kTerminated;
  attempt.ended(how);
  summary.run = how == "complete" ? 1 : 0;
  return summary;
}

}  // namespace duet
