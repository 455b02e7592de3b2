// duet train: this project's own trainers. `duet train wbc` makes WBC-Sim.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "duet/app/cli/field_options.h"
#include "duet/core/parallel.h"
#include "duet/core/require.h"
#include "duet/experiment/work/interrupt.h"
#include "duet/parts/training/part.h"
#include "duet/robots/robot_model.h"
#include "duet/training/setup/train_options.h"
#include "duet/training/setup/training_motions.h"
#include "duet/training/train_wbc.h"

namespace duet::cli {
namespace {

struct WbcArguments {
  WbcTraining training;
  bool smoke = false;
};

constexpr int kMotionsPerTask = 6;
constexpr int kSmokeEnvironments = 32;

// The number of threads: the machine's cores, but a number that divides the environments.
int dividing_threads() {
  int threads = std::min(default_threads(), kSmokeEnvironments);
  while (kSmokeEnvironments % threads != 0) --threads;
  return threads;
}

std::string line(const WbcProgress& progress) {
  const TrackingStatistics& t = progress.tracking;
  const double ticks = static_cast<double>(std::max(1L, t.ticks));
  std::string text =
      fmt::format("{:<8} {:>6.2f} M of {:.2f} M steps, {:>5.0f}/s, {} left", progress.stage,
                  static_cast<double>(progress.steps) * 1e-6, static_cast<double>(progress.steps_wanted) * 1e-6,
                  progress.steps_per_second, format_duration(std::max(0.0, progress.seconds_left)));
  text += find_wbc_stage(progress.stage).distils ? fmt::format("; loss {:.4f}", progress.loss)
                                                 : fmt::format("; return {:.1f}", progress.episode_return);
  return text + fmt::format(", falls {:.0f} %, root {:.1f} cm, upper body {:.1f} cm, action rate {:.2f}",
                            100.0 * progress.fall_share, 100.0 * t.root_xy / ticks, 100.0 * t.upper_body / ticks,
                            t.action_rate / ticks);
}

nlohmann::json json_of(const WbcProgress& progress) {
  return {{"stage", progress.stage},
          {"steps", progress.steps},
          {"steps_per_second", progress.steps_per_second},
          {"return", progress.episode_return},
          {"falls", progress.fall_share},
          {"loss", progress.loss}};
}

struct StageEnd {
  bool complete = false;
  WbcProgress first, last;
};

StageEnd train_stage(const Session& session, const std::shared_ptr<const RobotModel>& robot, const WbcRun& run) {
  StageEnd end;
  bool any = false;
  end.complete = train_wbc(
      robot, run,
      [&](const WbcProgress& progress) {
        if (!any) end.first = progress;
        any = true;
        end.last = progress;
        note(session, line(progress));
      },
      [] { return interrupt() != Interrupt::kNone; });
  return end;
}

// A small training whose outcome can be checked: the return of the oracle rises, and a student can be distilled from
// it.
std::vector<WbcRun> smoke_runs(const WbcRun& run) {
  const long steps = run.steps > 0 ? run.steps : 400'000;
  WbcRun stand = run;
  stand.environments = kSmokeEnvironments;
  WbcRun student = stand;
  stand.stage = "stand";
  stand.steps = steps;
  student.stage = "student";
  student.steps = steps / 4;
  student.from = wbc_checkpoint(run.folder, "stand");
  return {stand, student};
}

std::vector<WbcRun> runs_of(const WbcArguments& arguments) {
  WbcRun run = arguments.training.run;
  run.threads = arguments.training.threads.value_or(dividing_threads());
  if (arguments.smoke) return smoke_runs(run);
  if (arguments.training.stage == "all") return wbc_runs(run);
  run.stage = arguments.training.stage;
  return {run};
}

void train(Session& session, WbcArguments& arguments) {
  catch_interrupts();
  const auto robot = load_shared_robot(arguments.training.card);
  std::vector<WbcRun> runs = runs_of(arguments);
  nlohmann::json json = nlohmann::json::array();
  for (WbcRun& run : runs) {
    const std::string& stage = run.stage;
    if (!arguments.smoke && find_wbc_stage(stage).follows) {
      Progress progress(session.progress());
      run.motions = std::make_shared<const std::vector<RobotMotion>>(
          training_motions(*robot, kMotionsPerTask, run.threads, progress));
    }
    const StageEnd end = train_stage(session, robot, run);
    json.push_back(json_of(end.last));
    if (!end.complete) {
      note(session, fmt::format("stopped; the same command goes on from '{}'", wbc_checkpoint(run.folder, stage)));
      session.exit_code = interrupt() == Interrupt::kInterrupted ? kExitInterrupted : kExitResumable;
      return;
    }
    note(session, fmt::format("stage '{}' is complete: {}", stage, wbc_network_file(run.folder, stage)));
    if (arguments.smoke && stage == "stand" && end.last.steps > end.first.steps &&
        end.last.episode_return <= end.first.episode_return) {
      note(session, fmt::format("smoke test failed: the return went from {:.2f} to {:.2f}, expected it to rise",
                                end.first.episode_return, end.last.episode_return));
      session.exit_code = kExitGate;
      return;
    }
  }
  const std::string network = wbc_network_file(runs.back().folder, runs.back().stage);
  const WbcNetwork made = load_wbc_network(network, *robot);
  print(session, fmt::format("{}: {} inputs, {} outputs\n", network, made.mlp.inputs(), made.mlp.outputs()),
        {{"network", network}, {"stages", json}});
}

}  // namespace

void add_train(CLI::App& app, Session& session) {
  CLI::App* command = app.add_subcommand("train", "Train a controller or a policy of this project");
  command->require_subcommand(1);
  auto arguments = std::make_shared<WbcArguments>();
  CLI::App* wbc =
      add_command(*command, session, "wbc",
                  "WBC-Sim (supplement A.3.2): an oracle by PPO in stages, then a student by distillation.\n"
                  "Killed or stopped, the same command goes on from the last checkpoint",
                  "duet train wbc --smoke -o runs/wbc-smoke");
  add_fields(*wbc, wbc_training_fields(), arguments->training);
  wbc->add_flag("--smoke", arguments->smoke,
                "a small stand and student stage in minutes; fails (exit 1) where the return does not rise");
  wbc->callback([&session, arguments] { train(session, *arguments); });
  add_train_dstar(*command, session);
}

}  // namespace duet::cli
