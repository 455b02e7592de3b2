// Benchmarks of data: detectors on people, and recordings to a data set.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/archives/npy/npy.h"
#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "duet/core/require.h"
#include "duet/datasets/dataset.h"
#include "duet/datasets/labelled/detector_confusion.h"
#include "duet/experiment/work/run_work.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/parts/data/part.h"
#include "duet/parts/data/people_arguments.h"

namespace duet::cli {

// duet bench detectors: how well detectors tell the acts apart, on synthetic clips or on recordings with labels.

namespace {

struct DetectorArguments {
  std::string clips = "200";  // how many synthetic ones a task, or where recordings are
  std::string labels, thresholds;
  bool strict = false, list = false, csv = false;
  PeopleArguments people;
};

constexpr int kMostClips = 100000;

// Empty: all of them.
std::optional<ThresholdSet> set_of(const DetectorArguments& arguments) {
  require(!arguments.strict || arguments.thresholds.empty(), "--strict and --thresholds exclude each other");
  if (arguments.strict) return ThresholdSet::kStrict;
  if (arguments.thresholds.empty()) return std::nullopt;
  return parse_threshold_set(arguments.thresholds);
}

// A number says how many clips to make; nothing where it is a path.
std::optional<int> clip_count(const std::string& clips) {
  const std::optional<double> number = parse_number(clips);
  if (!number || std::filesystem::exists(clips)) return std::nullopt;
  require(*number >= 1 && *number <= kMostClips && *number == static_cast<int>(*number),
          "--clips: expected a whole number from 1 to {} or a path, found {}", kMostClips, clips);
  return static_cast<int>(*number);
}

void print_synthetic(const Session& session, int clips, ThresholdSet set, int threads) {
  const ConfusionTable table = detector_confusion(clips, threads, set);
  std::string text =
      fmt::format("{} synthetic clips a task, person against person, {} thresholds; fraction accepted\n{:<16}",
                  table.clips, to_string(set), "clips \\ detector");
  nlohmann::json json = {{"clips_per_task", table.clips}, {"rate", nlohmann::json::object()}};
  for (const std::string& task : table.tasks) text += fmt::format(" {:>10}", task);
  text += "\n";
  for (size_t i = 0; i < table.tasks.size(); ++i) {
    text += fmt::format("{:<16}", table.tasks[i]);
    for (size_t j = 0; j < table.tasks.size(); ++j) {
      text += fmt::format(" {:>9.1f}%", 100.0 * table.rate[i][j]);
      json["rate"][table.tasks[i]][table.tasks[j]] = table.rate[i][j];
    }
    text += "\n";
  }
  print(session, text, json);
}

std::string labelled_text(const std::vector<LabelledVerdicts>& verdicts, const std::vector<ThresholdSet>& sets,
                          const DetectorArguments& arguments) {
  const auto shown_as = [&](const TextTable& table) {
    return (arguments.csv ? csv_table(table) : markdown_table(table)) + "\n";
  };
  std::string text = shown_as(rates_table(detector_rates(verdicts, sets)));
  for (const ThresholdSet set : sets) text += shown_as(confusion_table(verdicts, set));
  if (arguments.list) text += shown_as(wrong_table(verdicts, sets));
  text.pop_back();
  return text;
}

void print_labelled(const Session& session, const DetectorArguments& arguments, int threads) {
  LabelledClips clips{
      .paths = {arguments.clips}, .format = arguments.people.format, .people = people_options(arguments.people)};
  if (!arguments.labels.empty()) clips.labels = read_clip_labels(arguments.labels);
  clips.threads = threads;
  Progress progress(session.progress());
  const std::vector<LabelledVerdicts> verdicts = judge_labelled(clips, [&](int done, int of) {
    if (done == 1) progress.start("judging", of, "clips");
    progress.advance();
  });
  progress.finish();
  const std::optional<ThresholdSet> one = set_of(arguments);
  const std::vector<ThresholdSet> sets =
      one ? std::vector{*one} : std::vector(kThresholdSets.begin(), kThresholdSets.end());
  const auto unread = std::count_if(verdicts.begin(), verdicts.end(),
                                    [](const LabelledVerdicts& clip) { return !clip.message.empty(); });
  if (unread > 0)
    note(session,
         fmt::format("{} of {} clips cannot be read and count nowhere; --list says why", unread, verdicts.size()));
  print(session, labelled_text(verdicts, sets, arguments), confusion_json(verdicts, sets, arguments.list));
}

void add_detector_options(CLI::App& command, DetectorArguments& arguments) {
  CLI::App& group = *command.add_option_group("detectors", "of `bench detectors`");
  group
      .add_option("--clips", arguments.clips,
                  "how many synthetic clips a task, or recordings: a file or folder of clips or of motions of others")
      ->capture_default_str();
  group.add_option("--labels", arguments.labels,
                   "CSV \"clip,label\" for recordings (default: their own labels); no label leaves a clip out");
  group
      .add_option("--thresholds", arguments.thresholds,
                  "paper, strict or act (default: paper; of recordings all three)")
      ->check(CLI::IsMember({"paper", "strict", "act"}));
  group.add_flag("--strict", arguments.strict, "the same as --thresholds strict");
  group.add_flag("--list", arguments.list, "of recordings also each wrong verdict");
  group.add_flag("--csv", arguments.csv, "tables of recordings as CSV");
  CLI::App& others = *command.add_option_group("recordings", "how `bench detectors` reads motions of others");
  add_people_options(others, arguments.people);
}

void run_bench_detectors(const Session& session, const DetectorArguments& arguments, int threads) {
  const std::optional<int> count = clip_count(arguments.clips);
  if (!count) return print_labelled(session, arguments, threads);
  require(arguments.labels.empty() && !arguments.list && !arguments.csv,
          "--labels, --list and --csv are for recordings: expected their path at --clips, found a number");
  print_synthetic(session, *count, set_of(arguments).value_or(ThresholdSet::kPaper), threads);
}

}  // namespace

Instead add_detector_tables(CLI::App& command) {
  auto arguments = std::make_shared<DetectorArguments>();
  add_detector_options(command, *arguments);
  return [arguments](Session& session, const GivenWords& given) {
    if (given.words != std::vector<std::string>{"detectors"}) return false;
    run_bench_detectors(session, *arguments, given.threads);
    return true;
  };
}

}  // namespace duet::cli

namespace duet {

// Recordings to data set, all stages: read, resample, judge, retarget, score, write.

namespace {

constexpr int kRecordings = 48;
constexpr double kRecordedRate = 120.0;  // of optical motion capture, as in Inter-X [Hz]

// (T, 2, 24, 3) at 120 Hz. Its seconds.
double write_recording(const std::string& path, int index) {
  SynthesisOptions options;
  options.index = index;
  const InteractionClip clip = synthesize(Task::kHandshake, options);
  const HumanMotion people[] = {resample(clip.a, kRecordedRate), resample(clip.b, kRecordedRate)};
  const int frames = people[0].frames();
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(frames) * 2 * kSmplJoints * 3);
  for (int t = 0; t < frames; ++t)
    for (const HumanMotion& person : people) {
      const PointTracks::ConstFrame frame = person.joints.frame(t);
      values.insert(values.end(), frame.data(), frame.data() + frame.size());
    }
  write_file(path,
             npy_bytes({.shape = {static_cast<std::size_t>(frames), 2, kSmplJoints, 3}, .values = std::move(values)}));
  return frames / kRecordedRate;
}

std::vector<BenchmarkFigure> time_dataset(const BenchmarkOptions& options) {
  const ScratchFolder folder;
  std::filesystem::create_directory(folder / "recordings");
  double recorded = 0.0;
  for (int i = 0; i < kRecordings; ++i)
    recorded += write_recording(folder / fmt::format("recordings/r{:02}.npy", i), i);
  DatasetPlan plan{.inputs = {folder / "recordings"},
                   .robots = {{.name = "g1", .model = load_shared_robot()}},
                   .pair = make_pair_options({{"mode", "best"}}),
                   .threads = options.threads};
  plan.people.task = Task::kHandshake;
  plan.people.rate_hz = kRecordedRate;
  plan.curation.gates.clear();  // all are made
  const double begin = wall_seconds();
  const DatasetSummary summary = make_dataset(plan, folder / "data");
  const double seconds = wall_seconds() - begin;
  const std::string name = "dataset/end_to_end";
  std::vector<BenchmarkFigure> figures = {at_least(name, recorded / seconds, "h/h", 1000.0),
                                          at_most(name + ":peak_memory", peak_memory_mib(), "MiB", 2048.0),
                                          {name + ":clips", static_cast<double>(summary.kept), "1", "", true}};
  double all = 0.0;
  for (const auto& [stage, time] : summary.seconds) all += time;
  for (const auto& [stage, time] : summary.seconds)
    figures.push_back({fmt::format("{}:{}", name, stage), 100.0 * time / all, "%", "", true});
  return figures;
}

}  // namespace

void add_dataset_benchmarks(std::vector<Benchmark>& list) {
  list.push_back(
      {"dataset/end_to_end",
       fmt::format("{} two-person recordings of 24 joints at 120 Hz to a data set of the G1 (mode best)", kRecordings),
       time_dataset});
}

}  // namespace duet
