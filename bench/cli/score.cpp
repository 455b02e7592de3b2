// duet score: the 18 retargeting metrics and the detectors, without physics.
#include "bench/score.h"

#include <fmt/format.h>

#include "bench/cli/command.h"
#include "bench/clips.h"
#include "bench/parallel.h"
#include "core/require.h"

namespace duet::cli {
namespace {

struct ScoreArguments {
  std::vector<std::string> inputs, readings;
  std::string card;
  bool each = false;
  int threads = default_threads();
};

std::string per_clip(const std::vector<ClipScore>& scores, const MetricReadings& readings) {
  std::string text;
  for (const ClipScore& score : scores)
    text += fmt::format("{}\n{}\n", score.clip, score_table(summarize_scores({score}, readings)));
  return text;
}

void run_score(const Session& session, const ScoreArguments& arguments) {
  Readings readings;
  for (const std::string& choice : arguments.readings) {
    const auto [option, value] = split_assignment(choice);
    set_reading(readings, option, value);
  }
  const auto robot = load_shared_robot(arguments.card);
  const std::vector<std::string> files = find_motion_files(arguments.inputs);
  std::vector<ClipScore> scores(files.size());
  Progress progress(session.progress());
  progress.start("scoring", static_cast<int>(files.size()), "clips");
  parallel_for_each(static_cast<int>(files.size()), arguments.threads, [&](int i) {
    scores[i] = score_clip(load_or_retarget(files[i], *robot, {}), robot, readings);
    progress.advance();
  });
  progress.finish();
  const auto summary = summarize_scores(scores, readings.metrics);
  print(session, (arguments.each ? per_clip(scores, readings.metrics) : "") + score_table(summary),
        score_json(scores, summary));
}

}  // namespace

void add_score(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "score", "the 18 retargeting metrics and the detectors, without physics",
                  "duet score paired --reading metrics.large_angle=entry");
  auto arguments = std::make_shared<ScoreArguments>();
  command->add_option("motions", arguments->inputs, "paired motions (NPZ), clips (retargeted first), or folders")
      ->required();
  command->add_option("--reading", arguments->readings,
                      "family.option=reading; `duet list readings` shows all (repeatable)");
  command->add_option("--card", arguments->card, "robot card (default: the G1 that ships with duet)");
  command->add_flag("--each", arguments->each, "a table for each clip too");
  command->add_option("-j,--threads", arguments->threads, "threads")->capture_default_str();
  command->callback([&session, arguments] { run_score(session, *arguments); });
}

}  // namespace duet::cli
