// duet synth: two-person clips made from nothing.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

#include "duet/bench/cli/command.h"
#include "duet/bench/suite_names.h"
#include "duet/core/digest.h"
#include "duet/core/parallel.h"
#include "duet/core/require.h"
#include "duet/motion/synthesis.h"
#include "duet/motion/tracked_clip.h"

namespace duet::cli {
namespace {

struct SynthArguments {
  std::string task;
  int count = 1;
  std::string output;
  std::string side, like = "rehearsed", outcome;
  bool as_tracked = false;
  int threads = default_threads();
  SynthesisOptions options;
};

std::vector<Task> chosen_tasks(const std::string& name) {
  if (name == "all") return {kPaperTasks.begin(), kPaperTasks.end()};
  return {parse_task(name)};
}

ActOutcome parse_outcome(const std::string& name) {
  const auto& known = kActOutcomeNames;
  const auto* const found = std::ranges::find(known, name);
  require(found != known.end(),
          fmt::format("--outcome: expected {}, {} or {}, found '{}'", known[0], known[1], known[2], name));
  return static_cast<ActOutcome>(found - known.begin());
}

void run_synth(const Session& session, SynthArguments arguments) {
  if (!arguments.side.empty()) {
    require(arguments.side == "left" || arguments.side == "right",
            fmt::format("--side: expected left or right, found '{}'", arguments.side));
    arguments.options.side = arguments.side == "left" ? Side::kLeft : Side::kRight;
  }
  arguments.options.like = likeness_of("--like", arguments.like);
  if (!arguments.outcome.empty()) arguments.options.outcome = parse_outcome(arguments.outcome);
  constexpr int kMost = 100000;
  require(arguments.count >= 1 && arguments.count <= kMost,
          fmt::format("--count: expected 1 to {} clips of each task, found {}", kMost, arguments.count));
  const std::vector<Task> tasks = chosen_tasks(arguments.task);
  const int total = static_cast<int>(tasks.size()) * arguments.count;
  std::vector<nlohmann::json> written(total);
  Progress progress(session.progress());
  progress.start("synthesising", total, "clips");
  parallel_for_each(total, arguments.threads, [&](int i) {
    SynthesisOptions options = arguments.options;
    options.index = arguments.options.index + i % arguments.count;
    InteractionClip clip = synthesize(tasks[i / arguments.count], options);
    if (arguments.as_tracked) clip = tracked(clip, {}, options.seed);
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
  suggest_next(session, fmt::format("duet retarget {} -o paired", arguments.output));
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
  command->add_option("--seed", arguments->options.seed, "of everything that is drawn")->capture_default_str();
  command->add_option("--first", arguments->options.index, "index of the first clip")->capture_default_str();
  add_threads(command, arguments->threads);
  const auto fixed = [&](const std::string& name, std::optional<double>& value, const std::string& what) {
    command->add_option_function<double>(
        name, [&value](double v) { value = v; }, what + " (default: drawn)");
  };
  fixed("--height-a", arguments->options.height_a, "height of person A [m]");
  fixed("--height-b", arguments->options.height_b, "height of person B [m]");
  fixed("--distance", arguments->options.distance, "distance at the start [m]");
  fixed("--angle", arguments->options.angle, "angle at which B stands off A's path [rad]");
  fixed("--target-height", arguments->options.target_height, "height of the contact or gesture [m]");
  fixed("--speed", arguments->options.speed, "walking speed [m/s]");
  fixed("--style", arguments->options.style, "0 restrained to 1 expansive");
  fixed("--duration", arguments->options.duration, "of the whole clip [s]");
  command
      ->add_option("--like", arguments->like,
                   "rehearsed: long acts of two who come from three metres; people: short acts of two who stand "
                   "close, cropped as recordings are")
      ->capture_default_str();
  fixed("--before", arguments->options.before, "like people: standing before anything moves [s]");
  fixed("--after", arguments->options.after, "like people: standing after everything [s]");
  command->add_option("--outcome", arguments->outcome, "like people: complete, hesitant or aborted (default: drawn)");
  command->add_flag("--tracked", arguments->as_tracked,
                    "as a depth camera would have it: 15 Hz, centimetres of noise, arms lost");
  command->add_option("--side", arguments->side, "hand of the act: left or right (default: drawn)");
  command->callback([&session, arguments] { run_synth(session, *arguments); });
}

}  // namespace duet::cli
