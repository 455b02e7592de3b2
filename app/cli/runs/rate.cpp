// duet rate: a blind page on which people judge episodes. duet agree: how far they and the detectors agree.
#include <fmt/format.h>

#include "duet/app/cli/run_notes.h"
#include "duet/app/command.h"
#include "duet/core/file.h"
#include "duet/replay/rating_page.h"
#include "duet/report/studies/studies.h"
#include "duet/rows/folder/run_directory.h"

namespace duet::cli {
namespace {

struct RateArguments {
  std::string run, output;
  RatingChoice choice;
};

void run_rate(Session& session, const RateArguments& arguments) {
  const ViewerBundle viewer = load_viewer("rate");
  const Run run = open_run(arguments.run);
  const std::string output = arguments.output.empty() ? inside(arguments.run, "rating.html") : arguments.output;
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
  std::vector<std::string> names;
  for (const Rater& rater : raters) names.push_back(rater.name);
  print(session, terminal_text(agreement.analysis),
        {{"run", arguments.run},
         {"raters", names},
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
