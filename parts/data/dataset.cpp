// duet dataset: recordings of others in, curated data sets of people and robots out.
#include "duet/parts/data/dataset.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <span>

#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/datasets/annotations.h"
#include "duet/datasets/dataset.h"
#include "duet/datasets/dataset_card.h"
#include "duet/datasets/entry.h"
#include "duet/datasets/interaction_tables.h"
#include "duet/datasets/people_clip.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/metrics/motion_windows.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/people/people_files.h"
#include "duet/motion/plausibility.h"
#include "duet/parts/data/part.h"
#include "duet/parts/data/people_arguments.h"
#include "duet/people/formats/people_formats.h"

namespace duet::cli {
namespace {

struct DatasetArguments {
  std::vector<std::string> inputs, limits, gates, robots = {"g1"}, pair;
  std::string output, annotations;
  std::vector<double> pad = {0.0, 0.0};
  bool no_curation = false, keep_rejected = false;
  int threads = default_threads();
  PeopleArguments people;
};

Gate parse_gate(const std::string& name) {
  std::vector<std::string> known;
  for (const Gate gate : all_gates()) {
    std::string word(to_string(gate));
    std::ranges::replace(word, ' ', '-');
    if (word == name) return gate;
    known.push_back(word);
  }
  throw std::invalid_argument(fmt::format("--gates: expected {}, found '{}'", fmt::join(known, ", "), name));
}

CurationOptions curation_options(const DatasetArguments& arguments) {
  CurationOptions options;
  require(!(arguments.no_curation && !arguments.gates.empty()), "--gates and --no-curation exclude each other");
  if (arguments.no_curation || !arguments.gates.empty()) options.gates.clear();
  for (const std::string& gate : arguments.gates) options.gates.push_back(parse_gate(gate));
  for (const std::string& limit : arguments.limits) {
    const auto [name, value] = split_assignment(limit);
    set_limit(options, name, value);
  }
  return options;
}

// A robot's folder is named after its card.
DatasetRobot robot_of(const std::string& card) {
  return {.name = std::filesystem::path(card).stem().string(), .model = load_shared_robot(card)};
}

DatasetPlan plan_of(const DatasetArguments& arguments, bool with_robots) {
  DatasetPlan plan{.inputs = arguments.inputs,
                   .format = arguments.people.format,
                   .people = people_options(arguments.people),
                   .curation = curation_options(arguments),
                   .pad_before = arguments.pad[0],
                   .pad_after = arguments.pad[1],
                   .keep_rejected = arguments.keep_rejected,
                   .threads = arguments.threads};
  if (!arguments.annotations.empty()) plan.annotations = read_annotations(arguments.annotations);
  std::vector<std::pair<std::string, std::string>> choices = {{"mode", "best"}};
  for (const std::string& option : arguments.pair) choices.push_back(split_assignment(option));
  plan.pair = make_pair_options(choices);
  validate(plan.pair);
  if (with_robots)
    for (const std::string& card : arguments.robots) plan.robots.push_back(robot_of(card));
  return plan;
}

std::string stage_times(const DatasetSummary& summary) {
  double all = 0.0;
  for (const auto& [stage, seconds] : summary.seconds) all += seconds;
  std::string text;
  for (const auto& [stage, seconds] : summary.seconds)
    text += fmt::format("{}{} {:.0f} %", text.empty() ? "" : ", ", stage, all > 0.0 ? 100.0 * seconds / all : 0.0);
  return text.empty() ? "" : fmt::format("time: {} of {}\n", text, format_duration(all));
}

// Recordings that are cropped to the act lack what comes before and after it. Users who see most refused for it
// are told that the time can be added.
std::string cropped_hint(const std::vector<DatasetEntry>& entries) {
  const std::vector<std::string> one_gate = {std::string(to_string(Gate::kTemporalCompleteness))};
  const auto cropped = std::ranges::count_if(entries, [&](const DatasetEntry& entry) {
    return entry.status == ClipStatus::kRejected && entry.gates == one_gate;
  });
  if (cropped == 0) return "";
  return fmt::format(
      "{} refused for the time before or after the act alone: if they are cropped to it, --gates "
      "motion-fidelity,interaction-clarity,kinematic-feasibility keeps them, and --pad 4,2 or suites/real.yaml adds "
      "the "
      "time\n",
      cropped);
}

std::string summary_text(const DatasetSummary& summary, const std::string& folder,
                         const std::vector<DatasetEntry>& entries) {
  std::string text = fmt::format("{}: {} clips of format '{}'{}\n\n{}\n", folder, summary.clips, summary.format,
                                 summary.from_before > 0 ? fmt::format(", {} from before", summary.from_before) : "",
                                 markdown_table(outcome_table(entries)));
  const TextTable refused = refused_table(entries);
  constexpr std::size_t kShownRefusals = 5;
  for (std::size_t i = 0; i < std::min(kShownRefusals, refused.rows.size()); ++i)
    text += fmt::format("{}: {}\n", refused.rows[i][0], refused.rows[i][3]);
  if (refused.rows.size() > kShownRefusals)
    text += fmt::format("... and {} more in {}/tables/refused.csv\n", refused.rows.size() - kShownRefusals, folder);
  return text + cropped_hint(entries) + stage_times(summary) + fmt::format("card: {}/card.html\n", folder);
}

nlohmann::json summary_json(const DatasetSummary& summary, const std::string& folder) {
  return {{"folder", folder},          {"format", summary.format},           {"clips", summary.clips},
          {"kept", summary.kept},      {"rejected", summary.rejected},       {"other_task", summary.other},
          {"failed", summary.failed},  {"from_before", summary.from_before}, {"stopped", summary.stopped},
          {"seconds", summary.seconds}};
}

void run_make(Session& session, const DatasetArguments& arguments, bool with_robots) {
  catch_interrupts();
  Progress progress(session.progress());
  DatasetEvents events;
  events.found = [&](int clips) { progress.start(with_robots ? "retargeting" : "curating", clips, "clips"); };
  events.finished = [&](const DatasetEntry&, bool) { progress.advance(); };
  events.stop = [] { return interrupt() != Interrupt::kNone; };
  const DatasetSummary summary = make_dataset(plan_of(arguments, with_robots), arguments.output, events);
  progress.finish();
  print(session, summary_text(summary, arguments.output, read_dataset(arguments.output)),
        summary_json(summary, arguments.output));
  if (summary.stopped) {
    note(session, "stopped early: the same command goes on");
    session.exit_code = interrupt() == Interrupt::kInterrupted ? kExitInterrupted : kExitResumable;
  } else if (summary.failed > 0) {
    session.exit_code = kExitErrors;
  }
}

// The output of inspect for one clip.
struct Inspected {
  std::string text;
  nlohmann::json json;
};

Inspected inspect_clip(const PeopleFormat& format, const ClipPlace& place, const PeopleOptions& options) {
  nlohmann::json json = {{"clip", place.id}, {"files", place.files}};
  std::string text = place.id + "\n";
  try {
    const PeopleClip clip = read_people_clip(format, place, options);
    json["label"] = clip.label;
    if (!clip.source) return {text + fmt::format("  its label '{}' is none of duet's tasks\n", clip.label), json};
    for (const std::string& sentence : clip.source->evidence) text += "  " + sentence + "\n";
    const InteractionClip& found = clip.source->clip;
    text += fmt::format("  {}: {} frames at {:g} Hz, act [{}, {})\n", to_string(found.task), found.frames(),
                        found.rate_hz(), found.phases.act_begin, found.phases.act_end);
    json["evidence"] = clip.source->evidence;
    json["task"] = to_string(found.task);
    json["frames"] = found.frames();
    for (const std::string& fault : curate(found).reasons()) text += "  a gate would refuse it: " + fault + "\n";
  } catch (const InputError& error) {
    text += fmt::format("  cannot be read: {}\n", error.what());
    json["error"] = error.what();
  }
  return {text, json};
}

// "labels: shaking 22 (handshake), kicking 51 (none of duet's tasks)".
void add_labels(const std::map<std::string, int>& labels, std::string& text, nlohmann::json& json) {
  std::string list;
  json["labels"] = nlohmann::json::array();
  for (const auto& [label, clips] : labels) {
    const std::optional<Task> task = label.empty() ? std::nullopt : task_of_label(label);
    const std::string ours = task ? std::string(to_string(*task)) : "none of duet's tasks";
    list += fmt::format("{}{} {}{}", list.empty() ? "" : ", ", label.empty() ? "without" : label, clips,
                        label.empty() || (task && label == ours) ? "" : fmt::format(" ({})", ours));
    json["labels"].push_back({{"label", label}, {"clips", clips}, {"task", task ? ours : ""}});
  }
  text += fmt::format("labels: {}\n", list.empty() ? "none can be read" : list);
}

void run_inspect(const Session& session, const DatasetArguments& arguments, int most) {
  const PeopleOptions options = people_options(arguments.people);
  const PeopleFormat& format = find_people_format(arguments.inputs, arguments.people.format);
  const std::vector<ClipPlace> places = format.find(arguments.inputs, options);
  std::string text = fmt::format("format: {} ({})\nlicence: {}\nclips: {}\n", format.name, format.what,
                                 format.licence.empty() ? "unknown" : format.licence, places.size());
  nlohmann::json json = {{"format", format.name},
                         {"licence", format.licence},
                         {"count", places.size()},
                         {"clips", nlohmann::json::array()}};
  add_labels(count_labels(format, places, options, arguments.threads), text, json);
  const std::size_t count = most > 0 ? std::min(places.size(), static_cast<std::size_t>(most)) : places.size();
  for (std::size_t i = 0; i < count; ++i) {
    Inspected inspected = inspect_clip(format, places[i], options);
    text += inspected.text;
    json["clips"].push_back(std::move(inspected.json));
  }
  if (count < places.size()) text += fmt::format("... and {} more (--most 0 shows all)\n", places.size() - count);
  print(session, text, json);
}

struct ExportArguments {
  std::string dataset, output, to;
  std::vector<std::string> robots;
  std::optional<double> rate_hz;
  int threads = default_threads();
};

// Those that the data set names, from their cards; a card elsewhere is told with --card.
std::vector<DatasetRobot> robots_of(const ExportArguments& arguments) {
  std::vector<DatasetRobot> robots;
  for (const std::string& card : arguments.robots) robots.push_back(robot_of(card));
  const nlohmann::json settings = read_dataset_settings(arguments.dataset);
  if (!settings.contains("robots")) return robots;
  for (const auto& [name, digest] : settings["robots"].items()) {
    if (std::ranges::count(robots, name, &DatasetRobot::name) == 0) robots.push_back(robot_of(name));
    const auto robot = std::ranges::find(robots, name, &DatasetRobot::name);
    if (robot->model->digest != digest)
      throw InputError(
          fmt::format("'{}': robot '{}' is not the one that the data set was made with", arguments.dataset, name));
  }
  return robots;
}

void run_export(Session& session, const ExportArguments& arguments) {
  catch_interrupts();
  RobotMotionWriting writing;
  writing.rate_hz = arguments.rate_hz;
  Progress progress(session.progress());
  DatasetEvents events;
  events.found = [&](int motions) { progress.start("converting", motions, "motions"); };
  events.finished = [&](const DatasetEntry&, bool) { progress.advance(); };
  events.stop = [] { return interrupt() != Interrupt::kNone; };
  const DatasetExport made = export_dataset(arguments.dataset, arguments.output, robots_of(arguments),
                                            robot_motion_format(arguments.to), writing, arguments.threads, events);
  progress.finish();
  if (made.objects_left_out > 0)
    note(session, fmt::format("the objects of {} motions stay behind: robot motions hold none", made.objects_left_out));
  print(session,
        fmt::format("{}: {} motions in format '{}'{}\n", arguments.output, made.motions, arguments.to,
                    made.from_before > 0 ? fmt::format(", {} from before", made.from_before) : ""),
        {{"folder", arguments.output},
         {"format", arguments.to},
         {"motions", made.motions},
         {"from_before", made.from_before},
         {"objects_left_out", made.objects_left_out},
         {"stopped", made.stopped}});
  if (made.stopped) session.exit_code = interrupt() == Interrupt::kInterrupted ? kExitInterrupted : kExitResumable;
}

void run_phases(const Session& session, int count, std::uint64_t seed, int threads) {
  constexpr int kMost = 10000;
  require(count >= 1 && count <= kMost, "--count: expected 1 to {} clips a task, found {}", kMost, count);
  const TextTable table = phase_error_table(phase_errors(kPaperTasks, count, seed, threads));
  print(session, markdown_table(table), {{"header", table.header}, {"rows", table.rows}});
}

void add_dataset_options(CLI::App& command, DatasetArguments& arguments) {
  command.add_option("inputs", arguments.inputs, "files or folders of recordings; two files: person A, person B")
      ->required();
  add_people_options(command, arguments.people);
}

void add_make_options(CLI::App& command, DatasetArguments& arguments) {
  add_dataset_options(command, arguments);
  command.add_option("-o,--output", arguments.output, "folder of the data set; the same command goes on in it")
      ->required();
  command.add_option("--gates", arguments.gates, "only these gates (default: all four)")->delimiter(',');
  command.add_option("--limit", arguments.limits,
                     "criterion=value; `duet list curation-criteria` shows all (repeatable)");
  command.add_flag("--no-curation", arguments.no_curation, "keep every clip that can be read");
  command.add_flag("--keep-rejected", arguments.keep_rejected, "make the files of rejected clips, too");
  command
      .add_option("--pad", arguments.pad,
                  "BEFORE,AFTER: seconds for which both stand still before and after what is kept (cropped recordings)")
      ->delimiter(',')
      ->expected(2);
  command.add_option("--annotations", arguments.annotations, "phases, tasks and roles by hand (annotations.csv)");
  add_threads(&command, arguments.threads);
}

void add_inspect(CLI::App& dataset, Session& session) {
  CLI::App* command = add_command(dataset, session, "inspect", "what recordings are, and what would become of them",
                                  "duet dataset inspect recordings");
  auto arguments = std::make_shared<DatasetArguments>();
  auto most = std::make_shared<int>(10);
  add_dataset_options(*command, *arguments);
  command->add_option("--most", *most, "clips to look at; 0: all")->capture_default_str();
  command->callback([&session, arguments, most] { run_inspect(session, *arguments, *most); });
}

void add_curate(CLI::App& dataset, Session& session) {
  CLI::App* command = add_command(dataset, session, "curate", "people only: read, judge by the four gates, annotate",
                                  "duet dataset curate recordings -o people");
  auto arguments = std::make_shared<DatasetArguments>();
  add_make_options(*command, *arguments);
  command->callback([&session, arguments] { run_make(session, *arguments, false); });
}

void add_dataset_retarget(CLI::App& dataset, Session& session) {
  CLI::App* command = add_command(dataset, session, "retarget", "recordings of two people in, people and robots out",
                                  "duet dataset retarget A.bvh B.bvh -o data\n"
                                  "  duet dataset retarget recordings --card g1,t1 -o data");
  auto arguments = std::make_shared<DatasetArguments>();
  add_make_options(*command, *arguments);
  command->add_option("--card", arguments->robots, "robot cards by name or path, one folder each")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--option", arguments->pair,
                      "name=value; `duet list pair-options` shows all; mode=best unless told (repeatable)");
  command->callback([&session, arguments] { run_make(session, *arguments, true); });
}

void add_dataset_convert(CLI::App& dataset, Session& session) {
  CLI::App* command = add_command(dataset, session, "convert", "the robots of a data set in the format of another tool",
                                  "duet dataset convert data --to gmr -o gmr");
  auto arguments = std::make_shared<ExportArguments>();
  command->add_option("dataset", arguments->dataset, "a data set")->required();
  command->add_option("--to", arguments->to, "format to write, of `duet list robot-formats`")->required();
  command->add_option("-o,--output", arguments->output, "folder; the same command goes on in it")->required();
  command->add_option_function<double>(
      "--rate", [arguments](double v) { arguments->rate_hz = v; },
      "frames per second of what is written (default: 50, or the format's where its files hold none)");
  command->add_option("--card", arguments->robots, "cards of robots that do not ship")->delimiter(',');
  add_threads(command, arguments->threads);
  command->callback([&session, arguments] { run_export(session, *arguments); });
}

void add_phases(CLI::App& dataset, Session& session) {
  CLI::App* command =
      add_command(dataset, session, "phases", "how well phases are proposed, where synthesis knows them",
                  "duet dataset phases --count 50 --seed 1");
  auto count = std::make_shared<int>(20);
  auto seed = std::make_shared<std::uint64_t>(0);
  auto threads = std::make_shared<int>(default_threads());
  command->add_option("--count", *count, "clips of each task")->capture_default_str();
  command->add_option("--seed", *seed, "of the clips")->capture_default_str();
  add_threads(command, *threads);
  command->callback([&session, count, seed, threads] { run_phases(session, *count, *seed, *threads); });
}

}  // namespace

void add_dataset(CLI::App& app, Session& session) {
  CLI::App* dataset = app.add_subcommand("dataset", "data sets: recordings of others in, people and robots out");
  dataset->require_subcommand(1);
  add_inspect(*dataset, session);
  add_curate(*dataset, session);
  add_dataset_retarget(*dataset, session);
  add_dataset_convert(*dataset, session);
  add_dataset_stats(*dataset, session);
  add_phases(*dataset, session);
}

namespace {

std::vector<std::string> files_of(const std::string& folder) {
  try {
    return find_clip_files({folder});
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}; expected a data set of duet or clips (NPZ)", error.what()));
  }
}

// Statistics of the people of a data set, or of the clips in a folder.
InteractionSet interactions_of(const std::string& folder) {
  const std::vector<std::string> files = files_of(folder);
  InteractionSet set{.name = std::filesystem::path(folder).lexically_normal().filename().string(),
                     .tasks = std::vector<Task>(files.size(), Task::kHug),
                     .clips = std::vector<InteractionStatistics>(files.size()),
                     .windows = std::vector<std::vector<std::vector<double>>>(files.size())};
  parallel_for_each(static_cast<int>(files.size()), default_threads(), [&](int i) {
    const InteractionClip clip = load_clip(files[i]);
    set.tasks[i] = clip.task;
    set.clips[i] = interaction_statistics(clip);
    set.windows[i] = motion_windows(clip);
  });
  return set;
}

nlohmann::json json_of(const TextTable& table) { return {{"header", table.header}, {"rows", table.rows}}; }

// The tables of one task: each set beside the others, and how well they are told apart.
void add_task(std::span<const InteractionSet> sets, Task task, std::string& text, nlohmann::json& entry) {
  const bool pair = sets.size() == 2;
  const TextTable table = pair ? interaction_table(sets[0], sets[1], task) : interaction_table(sets, task);
  text += markdown_table(table) + "\n";
  entry = json_of(table);
  if (sets.size() == 1) return;
  if (pair) {
    const InteractionAgreement found = interaction_agreement(sets[0], sets[1], task);
    text += fmt::format("{}: {} of {} statistics within {:.0f} %\n\n", to_string(task), found.agreeing, found.compared,
                        100.0 * kAgreement);
    entry["agreeing"] = found.agreeing;
    entry["compared"] = found.compared;
  }
  const TextTable apart = told_apart_table(sets, task);
  const std::string by = told_by(sets, task);
  text += markdown_table(apart) + "\n" + by + (by.empty() ? "" : "\n");
  entry["told_apart"] = json_of(apart);
  entry["told_by"] = by;
}

// Tables of people, one a task; with other sets those of tasks that the first and one of them have.
void add_interactions(const std::string& folder, const std::vector<std::string>& against, std::string& text,
                      nlohmann::json& json) {
  std::vector<InteractionSet> sets = {interactions_of(folder)};
  for (const std::string& other : against) sets.push_back(interactions_of(other));
  for (const Task task : all_tasks()) {
    if (sets[0].of(task).empty()) continue;
    std::vector<InteractionSet> having;
    for (const InteractionSet& set : sets)
      if (!set.of(task).empty()) having.push_back(set);
    if (!against.empty() && having.size() == 1) continue;
    add_task(having, task, text, json["interactions"][std::string(to_string(task))]);
  }
  if (!json.contains("interactions"))
    throw InputError(fmt::format("'{}' and '{}' have no task in common", folder, fmt::join(against, "', '")));
}

void add_entries(const std::vector<DatasetEntry>& entries, std::string& text, nlohmann::json& json) {
  for (const auto& [name, table] : {std::pair{"tasks", task_table(entries)},
                                    {"outcomes", outcome_table(entries)},
                                    {"curation", curation_table(entries)},
                                    {"retargeting", retargeting_table(entries)}}) {
    if (table.rows.empty()) continue;
    text += markdown_table(table) + "\n";
    json[name] = {{"header", table.header}, {"rows", table.rows}};
  }
}

// Prints the statistics; for a data set its own tables, too, unless it is held against another.
void run_stats(const Session& session, const std::string& folder, const std::vector<std::string>& against) {
  const bool made = is_dataset(folder);
  const std::vector<DatasetEntry> entries =
      made && against.empty() ? read_dataset(folder) : std::vector<DatasetEntry>{};
  std::string text;
  nlohmann::json json = nlohmann::json::object();
  if (!made || !against.empty()) add_interactions(folder, against, text, json);
  if (!entries.empty()) {
    add_entries(entries, text, json);
    if (std::ranges::count(entries, ClipStatus::kKept, &DatasetEntry::status) > 0)
      add_interactions(folder, against, text, json);
  }
  print(session, text, json);
}

}  // namespace

void add_dataset_stats(CLI::App& dataset, Session& session) {
  CLI::App* command = add_command(dataset, session, "stats", "the tables of a data set, and how its people interact",
                                  "duet dataset stats data\n"
                                  "  duet dataset stats clips --against recorded others");
  auto folder = std::make_shared<std::string>();
  auto against = std::make_shared<std::vector<std::string>>();
  command->add_option("folder", *folder, "a data set, or a folder of clips of two people")->required();
  command->add_option("--against", *against,
                      "others, to hold the interactions of the first against, and to tell them apart");
  command->callback([&session, folder, against] { run_stats(session, *folder, *against); });
}

}  // namespace duet::cli
