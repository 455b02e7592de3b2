// duet score: motions and recordings, without physics: the 18 retargeting metrics, diagnostics, detectors.
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "duet/app/part.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/scoring/motion_scores.h"
#include "duet/scoring/recording_scores.h"

namespace duet::cli {
namespace {

struct ScoreArguments {
  std::vector<std::string> inputs, readings;
  std::string card, thresholds = "paper";
  bool each = false, as_is = false, all_detectors = false, all_readings = false;
  int threads = default_threads();
};

// The score of one file: a motion's or a recording's.
struct FileScore {
  std::optional<ClipScore> clip;
  std::optional<RecordingScore> recording;
  std::vector<std::string> notes;
};

struct Scores {
  std::vector<ClipScore> clips;
  std::vector<RecordingScore> recordings;
};

ScoreOptions options_of(const ScoreArguments& arguments) {
  ScoreOptions options;
  for (const std::string& choice : arguments.readings) {
    const auto [option, value] = split_assignment(choice);
    set_reading(options.readings, option, value);
  }
  options.thresholds = parse_threshold_set(arguments.thresholds);
  options.all_detectors = arguments.all_detectors;
  options.all_readings = arguments.all_readings;
  return options;
}

FileScore score_file(const std::string& file, const std::shared_ptr<const RobotModel>& robot,
                     const ScoreArguments& arguments, const ScoreOptions& options) {
  const Npz npz = Npz::load(file);
  FileScore score;
  if (kind_of(npz) == MotionFile::kRecording) {
    score.recording = score_recording_file(file, npz, arguments.card.empty() ? nullptr : robot, options);
    return score;
  }
  LoadedMotion loaded =
      load_or_retarget(npz, *robot, {}, arguments.as_is ? Implausible::kAllowed : Implausible::kRefused);
  score.clip = score_clip(loaded.motion, robot, options);
  score.notes = std::move(loaded.notes);
  return score;
}

Scores score_files(const Session& session, const ScoreArguments& arguments, const ScoreOptions& options) {
  const auto robot = load_shared_robot(arguments.card);
  const std::vector<std::string> files = find_motion_files(arguments.inputs);
  std::vector<FileScore> found(files.size());
  Progress progress(session.progress());
  progress.start("scoring", static_cast<int>(files.size()), "files");
  parallel_for_each(static_cast<int>(files.size()), arguments.threads, [&](int i) {
    found[i] = with_file_context(files[i], [&] { return score_file(files[i], robot, arguments, options); });
    progress.advance();
  });
  progress.finish();
  Scores scores;
  for (FileScore& score : found) {
    for (const std::string& sentence : score.notes) note(session, sentence);
    if (score.clip) scores.clips.push_back(std::move(*score.clip));
    if (score.recording) scores.recordings.push_back(std::move(*score.recording));
  }
  return scores;
}

std::string per_clip(const std::vector<ClipScore>& scores, const MetricReadings& readings) {
  std::string text;
  for (const ClipScore& score : scores) {
    text += fmt::format("{}\n{}\n", score.clip, score_table(summarize_scores({score}, readings)));
    if (!score.detectors.empty()) text += detectors_table(score.detectors) + "\n";
  }
  return text;
}

// The text of --all-detectors: for one clip what each measured, for many how many each accepts.
std::string all_detectors_text(const std::vector<ClipScore>& clips) {
  if (clips.size() == 1) return "\n" + detectors_table(clips.front().detectors);
  std::map<std::string, std::vector<std::vector<DetectorScore>>> by_task;
  for (const ClipScore& clip : clips) by_task[clip.task].push_back(clip.detectors);
  return "\n" + acceptance_table(by_task);
}

std::string clips_text(const std::vector<ClipScore>& clips, const ScoreArguments& arguments,
                       const MetricReadings& readings) {
  if (clips.empty()) return "";
  std::string text = (arguments.each ? per_clip(clips, readings) : "") + score_table(summarize_scores(clips, readings));
  if (arguments.all_detectors && !(arguments.each && clips.size() == 1)) text += all_detectors_text(clips);
  if (arguments.all_readings) text += "\n" + readings_table(clips);
  return text;
}

std::string recordings_text(const std::vector<RecordingScore>& recordings, bool each) {
  std::string text;
  if (each || recordings.size() == 1)
    for (const RecordingScore& score : recordings) text += recording_text(score) + "\n";
  if (recordings.size() > 1) text += recordings_table(recordings);
  return text;
}

void run_score(Session& session, const ScoreArguments& arguments) {
  const ScoreOptions options = options_of(arguments);
  const Scores scores = score_files(session, arguments, options);
  const MetricReadings& readings = options.readings.metrics;
  nlohmann::json json = nlohmann::json::object();
  if (!scores.clips.empty()) json = score_json(scores.clips, summarize_scores(scores.clips, readings));
  json["thresholds"] = arguments.thresholds;
  if (!scores.recordings.empty()) json["recordings"] = recordings_json(scores.recordings);
  print(session, clips_text(scores.clips, arguments, readings) + recordings_text(scores.recordings, arguments.each),
        json);
  const bool other = std::any_of(scores.recordings.begin(), scores.recordings.end(),
                                 [](const RecordingScore& score) { return !score.differences.empty(); });
  if (other) session.exit_code = kExitDeterminism;
}

}  // namespace

void add_score(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "score",
                                  "clips and paired motions: the 18 retargeting metrics and the detectors; recordings: "
                                  "diagnostics, detectors, and of those that a run kept the row again",
                                  "duet score paired --reading metrics.large_angle=entry\n"
                                  "  duet score handshake.npz --thresholds strict --all-detectors\n"
                                  "  duet score runs/core/trajectories\n"
                                  "  duet score clips --people");
  auto arguments = std::make_shared<ScoreArguments>();
  command
      ->add_option("motions", arguments->inputs,
                   "paired motions (NPZ), clips (retargeted first), recordings, or folders")
      ->required();
  command->add_option("--reading", arguments->readings,
                      "family.option=reading; `duet list readings` shows all (repeatable)");
  command->add_option("--thresholds", arguments->thresholds, "of the detectors; `duet list detectors` shows them")
      ->check(CLI::IsMember({"paper", "strict", "act"}))
      ->capture_default_str();
  command->add_flag("--all-detectors", arguments->all_detectors,
                    "every task's detector with values, thresholds and margins, for people and robot");
  command->add_flag("--all-readings", arguments->all_readings, "the retargeting metrics under every reading");
  command->add_option("--card", arguments->card,
                      "robot card (default: the G1 that ships with duet; of a run's recording the run's)");
  command->add_flag("--each", arguments->each,
                    "a table for each motion too; of people each whom the rule judges wrongly");
  command->add_flag("--as-is", arguments->as_is, "take clips however implausible their people are");
  const Instead of_part = added_by_part("score", *command);
  add_threads(command, arguments->threads);
  command->callback([&session, arguments, of_part] {
    if (!of_part(session, {arguments->inputs, arguments->each, arguments->threads})) run_score(session, *arguments);
  });
}

}  // namespace duet::cli
