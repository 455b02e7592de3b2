// duet bench detectors: how well detectors tell the acts apart, on synthetic clips or on recordings with labels.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/core/number.h"
#include "duet/core/require.h"
#include "duet/datasets/labelled/detector_confusion.h"
#include "duet/experiment/work/progress.h"
#include "duet/parts/data/part.h"
#include "duet/parts/data/people_arguments.h"

namespace duet::cli {
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
