// duet synth: two-person clips made from nothing.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>

#include "duet/app/cli/arguments.h"
#include "duet/app/command.h"
#include "duet/app/option_sections.h"
#include "duet/core/digest.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/motion/people/tracked_clip.h"
#include "duet/motion/synthesis/synthesis.h"

namespace duet::cli {
namespace {

struct SynthArguments {
  std::string task;
  int count = 1;
  std::string output;
  bool as_tracked = false;
  int threads = default_threads();
  SynthesisOptions options;
};

std::vector<Task> chosen_tasks(const std::string& name) {
  if (name == "all") return {kPaperTasks.begin(), kPaperTasks.end()};
  return {parse_task(name)};
}

void run_synth(const Session& session, SynthArguments arguments) {
  constexpr int kMost = 100000;
  require(arguments.count >= 1 && arguments.count <= kMost, "--count: expected 1 to {} clips of each task, found {}",
          kMost, arguments.count);
  const std::vector<Task> tasks = chosen_tasks(arguments.task);
  const int total = static_cast<int>(tasks.size()) * arguments.count;
  std::vector<nlohmann::json> written(total);
  Progress progress(session.progress());
  progress.start("synthesising", total, "clips");
  parallel_for_each(total, arguments.threads, [&](int i) {
    SynthesisOptions options = arguments.options;
    options.index = arguments.options.index + i % arguments.count;
    InteractionClip clip = synthesize(tasks[i / arguments.count], options);
    if (arguments.as_tracked) clip = add_tracker_noise(clip, tracker_of(clip, options.seed), options.seed);
    const std::string path = (std::filesystem::path(arguments.output) / (clip.id + ".npz")).string();
    save_clip(clip, path);
    written[i] = {{"file", path},
                  {"task", to_string(clip.task)},
                  {"seconds", clip.frames() / clip.rate_hz()},
                  {"frames", clip.frames()},
                  {"sha256", sha256_file(path)}};
    progress.advance();
  });
  progress.finish();
  print(session, fmt::format("{} clips in {}", total, arguments.output), {{"clips", written}});
  suggest_next(session, fmt::format("duet retarget {} -o paired", shell_word(arguments.output)));
}

}  // namespace

void add_synth(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "synth", "synthesise two-person clips of a task",
                                  "duet synth handshake --count 20 --seed 7 --output clips\n"
                                  "  duet synth hug --like people --tracked --count 20 --output clips");
  auto arguments = std::make_shared<SynthArguments>();
  command
      ->add_option("task", arguments->task,
                   fmt::format("{}; all: the first six", fmt::join(task_names(all_tasks()), ", ")))
      ->required();
  command->add_option("-o,--output", arguments->output, "folder for the clips (NPZ)")->required();
  command->add_option("-n,--count", arguments->count, "clips of each task")->capture_default_str();
  add_threads(command, arguments->threads);
  add_fields(*command, synthesis_fields(), arguments->options);
  command->add_flag("--tracked", arguments->as_tracked,
                    "as a depth camera would have it: 15 Hz, centimetres of noise, arms lost");
  command->callback([&session, arguments] { run_synth(session, *arguments); });
}

}  // namespace duet::cli
