// duet replay: episodes as a page that shows them in 3-D, as MCAP for Foxglove, or as a film.
#include <fmt/format.h>

#include <filesystem>

#include "duet/app/cli/run_notes.h"
#include "duet/app/command.h"
#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "duet/core/machine.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/replay/replay_content.h"
#include "duet/replay/replay_page.h"
#include "duet/replay/replay_source.h"
#include "duet/report/studies/studies.h"
#include "duet/rows/folder/run_directory.h"

namespace duet::cli {
namespace {

struct ReplayArguments {
  std::vector<std::string> sources;
  std::string output, format;
  ReplayChoice choice;
};

const std::vector<std::string> kReplayFormats = {"html", "mcap"};

std::string format_of(const ReplayArguments& arguments) {
  std::string format = arguments.format;
  if (format.empty() && !arguments.output.empty()) {
    const std::string ending = std::filesystem::path(arguments.output).extension().string();
    require(ending.size() > 1,
            "--output '{}': expected a name that ends in .html or .mcap, or --format beside "
            "it, found no ending",
            arguments.output);
    format = ending.substr(1);
  }
  if (format.empty()) format = "html";
  require_known("format", format, kReplayFormats);
  return format;
}

std::string output_of(const ReplayArguments& arguments, const std::string& format, bool is_run) {
  if (!arguments.output.empty()) return arguments.output;
  return is_run ? join_without_links(arguments.sources.front(), "replay." + format) : "replay." + format;
}

// A run's folder, or one with runs in it, which load_run refuses by their names; others hold motions.
bool is_run_folder(const std::string& folder) {
  namespace fs = std::filesystem;
  if (!fs::is_directory(folder)) return false;
  const auto has_run = [](const fs::path& path) { return fs::exists(path / "run.json"); };
  return has_run(folder) || std::ranges::any_of(fs::directory_iterator(folder), has_run);
}

ReplayContent content_of(const ReplayArguments& arguments, bool is_run, Progress& progress) {
  if (!is_run) return replay_of_files(find_motion_files(arguments.sources), arguments.choice.card);
  require(arguments.sources.size() == 1, "expected one run, or motions (NPZ); found several sources, the first a run");
  return replay_of_run(load_run(arguments.sources.front()), arguments.choice, progress);
}

// "replay.html", "replay-2.html", ...
std::string part_name(const std::string& path, std::size_t part) {
  if (part == 0) return path;
  const std::filesystem::path file(path);
  return (file.parent_path() / fmt::format("{}-{}{}", file.stem().string(), part + 1, file.extension().string()))
      .string();
}

struct Written {
  std::string text;
  nlohmann::json files = nlohmann::json::array();

  void add(const std::string& path, std::size_t bytes, const std::vector<std::string>& scenes) {
    text += fmt::format("wrote {} ({:.2f} MB, {} clip{})\n", path, static_cast<double>(bytes) / 1e6, scenes.size(),
                        scenes.size() == 1 ? "" : "s");
    files.push_back({{"path", path}, {"bytes", bytes}, {"scenes", scenes}});
  }
};

Written write_pages(const ReplayContent& content, const ViewerBundle& viewer, const std::string& output) {
  Written written;
  const std::vector<ReplayPage> pages = replay_pages(content, viewer);
  FileBatch batch;
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const std::string path = part_name(output, i);
    batch.write(path, pages[i].html);
    written.add(path, pages[i].html.size(), pages[i].scenes);
  }
  batch.put_in_place();
  if (pages.size() > 1)
    written.text += fmt::format("split into {} pages: one of them all would be above {:.0f} MB\n", pages.size(),
                                static_cast<double>(kMostPageBytes) / 1e6);
  return written;
}

Written write_mcap(const ReplayContent& content, const std::string& output) {
  Written written;
  std::vector<std::string> scenes;
  for (const ReplayScene& scene : content.scenes) scenes.push_back(scene.id);
  write_replay_mcap(content, output);
  written.add(output, std::filesystem::file_size(output), scenes);
  return written;
}

int changed_tracks(const ReplayContent& content) {
  int changed = 0;
  for (const ReplayScene& scene : content.scenes)
    for (const ReplayTrack& track : scene.tracks) changed += track.origin.find("NOT") != std::string::npos ? 1 : 0;
  return changed;
}

void run_replay_command(Session& session, const ReplayArguments& arguments) {
  const std::string format = format_of(arguments);
  const std::string& source = arguments.sources.front();
  const bool is_run = is_run_folder(source);
  const std::string output = output_of(arguments, format, is_run);
  const ViewerBundle viewer = format == "html" ? load_viewer() : ViewerBundle{};  // before an hour of episodes
  Progress progress(session.progress());
  const ReplayContent content = content_of(arguments, is_run, progress);
  Written written = format == "html" ? write_pages(content, viewer, output) : write_mcap(content, output);
  for (const std::string& note : content.notes) written.text += note + '\n';
  const int changed = changed_tracks(content);
  if (changed > 0)
    warn(fmt::format("{} episodes that were run again had other states than in the run; the page marks them", changed));
  print(session, written.text, {{"files", written.files}, {"notes", content.notes}, {"changed", changed}});
  suggest_next(session, format == "html" ? fmt::format("open {} in a browser", output) : "open it in Foxglove");
}

void add_choice(CLI::App& command, ReplayChoice& choice) {
  command
      .add_option("--episodes", choice.episodes,
                  "beginnings of episode keys, or task/clip/episode (default: where the tracks agree least)")
      ->delimiter(',');
  command.add_option("--engines", choice.engines, "only these")->delimiter(',');
  command.add_option("--controllers", choice.controllers, "only these (default: the best one)")->delimiter(',');
  command.add_option("--policies", choice.policies, "only these, and the null arm")->delimiter(',');
  command.add_option("--perturbations", choice.perturbations, "only these")->delimiter(',');
  command.add_option("--tasks", choice.tasks, "only these")->delimiter(',');
  command.add_option("--scenes", choice.scenes, "clips at most, where no episode is named")
      ->capture_default_str()
      ->check(CLI::Range(1, 100000));
  command.add_option("--card", choice.card, "robot card, name or file (default: the one of the row's digest)");
  command.add_flag("--run-again", choice.run_again, "also what the run has kept; says whether the states are the same");
}

}  // namespace

void add_replay(CLI::App& app, Session& session) {
  CLI::App* command = add_command(
      app, session, "replay",
      "episodes, clips and paired motions in 3-D: one page that opens from disk, or MCAP for Foxglove",
      "duet replay runs/core -o replay.html\n  duet replay runs/core --episodes "
      "hug/hug_000/0 --controllers vmc,pd\n  duet replay handshake.npz handshake_paired.npz -o motions.html");
  auto arguments = std::make_shared<ReplayArguments>();
  command
      ->add_option("source", arguments->sources,
                   "run directory; or clips, paired motions and recordings (NPZ), also a folder of them")
      ->required();
  command->add_option("-o,--output", arguments->output, "file (default: replay.html, of a run in its directory)");
  command->add_option("-f,--format", arguments->format, "html, mcap (default: by the output's ending)");
  add_choice(*command, arguments->choice);
  arguments->choice.threads = default_threads();
  add_threads(command, arguments->choice.threads);
  add_allow_programs(*command, arguments->choice.allow_programs);
  command->callback([&session, arguments] { run_replay_command(session, *arguments); });
}

// duet rate: a blind page on which people judge episodes. duet agree: how far they and the detectors agree.

namespace {

struct RateArguments {
  std::string run, output;
  RatingChoice choice;
};

void run_rate(Session& session, const RateArguments& arguments) {
  const ViewerBundle viewer = load_viewer("rate");
  const Run run = open_run(arguments.run);
  const std::string output =
      arguments.output.empty() ? join_without_links(arguments.run, "rating.html") : arguments.output;
  Progress progress(session.progress());
  const ReplayContent content = rating_content(run, arguments.choice, progress);
  const std::string page = rating_page(content, viewer);
  write_file(output, page);
  const std::size_t found = content.scenes.size();
  std::vector<std::string> keys;
  for (const ReplayScene& scene : content.scenes) keys.push_back(scene.id);
  std::string text = fmt::format("wrote {} ({:.2f} MB, {} episode{})\n", output, static_cast<double>(page.size()) / 1e6,
                                 found, found == 1 ? "" : "s");
  if (found < static_cast<std::size_t>(arguments.choice.count))
    text += fmt::format("fewer than the {} asked for: the run has kept recordings of no others that differ\n",
                        arguments.choice.count);
  print(session, text,
        {{"path", output}, {"bytes", page.size()}, {"seed", arguments.choice.seed}, {"episodes", std::move(keys)}});
  suggest_next(session, fmt::format("give {} to each rater; then duet agree {} RATINGS.csv...", output, arguments.run));
}

struct AgreeArguments {
  std::string run;
  std::vector<std::string> ratings;
  IntervalOptions options;
};

void run_agree(Session& session, const AgreeArguments& arguments) {
  const Run run = open_run(arguments.run);
  const std::vector<Rater> raters = read_ratings(arguments.ratings, run.rows, arguments.run);
  const HumanAgreement agreement = human_agreement(run.rows, raters, arguments.options);
  print(session, terminal_text(agreement.analysis),
        {{"run", arguments.run},
         {"raters", names_of(raters)},
         {"episodes", agreement.episodes},
         {"majority", {{"yes", agreement.yes}, {"no", agreement.no}}},
         {"agreement", analysis_json(agreement.analysis)},
         {"disputes", agreement.disputes}});
}

}  // namespace

void add_rate(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "rate",
                                  "a blind page of a run's episodes on which a person says yes, no or unsure to each",
                                  "duet rate runs/core -o rating.html --count 50 --seed 7");
  auto arguments = std::make_shared<RateArguments>();
  command->add_option("run", arguments->run, "run directory with trajectories (record.trajectories: all)")->required();
  command->add_option("-o,--output", arguments->output, "page (default: rating.html in the run's directory)");
  command->add_option("--count", arguments->choice.count, "episodes, about as many of each task")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  command->add_option("--seed", arguments->choice.seed, "draws the episodes and their order")->capture_default_str();
  command->add_option("--card", arguments->choice.card,
                      "robot card, name or file (default: the one of the row's digest)");
  command->callback([&session, arguments] { run_rate(session, *arguments); });
}

void add_agree(CLI::App& app, Session& session) {
  CLI::App* command = add_command(
      app, session, "agree",
      "how far raters of a run's episodes agree with one another and with each detector; what is in dispute",
      "duet agree runs/core ratings-anna.csv ratings-ben.csv ratings-carla.csv");
  auto arguments = std::make_shared<AgreeArguments>();
  command->add_option("run", arguments->run, "run directory that was rated")->required();
  command->add_option("ratings", arguments->ratings, "CSV files that the page exported, one a rater")->required();
  command->add_option("--level", arguments->options.level, "of intervals")
      ->capture_default_str()
      ->check(CLI::Range(0.5, 0.9999));
  command->add_option("--resamples", arguments->options.resamples, "of the bootstrap over clips")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  command->add_option("--seed", arguments->options.seed, "of the bootstrap over clips")->capture_default_str();
  command->callback([&session, arguments] { run_agree(session, *arguments); });
}

}  // namespace duet::cli
