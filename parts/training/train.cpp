// duet train: this project's own trainers. `duet train wbc` makes WBC-Sim.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "duet/app/cli/arguments.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/experiment/plan/shipped_suites.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/parts/training/part.h"
#include "duet/policies/dstar/network.h"
#include "duet/robots/robot_model.h"
#include "duet/training/dstar/trainer.h"
#include "duet/training/dstar/windows.h"
#include "duet/training/setup/demonstrations.h"
#include "duet/training/setup/train_options.h"
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

// duet train dstar | dp | <ablation>: the learnt policies, and the split of clips that they never see.

namespace {

namespace fs = std::filesystem;

struct DstarArguments : PolicyTraining {
  bool smoke = false;
};

constexpr const char* kRetrieval = "retrieval";
constexpr int kLibraryWindows = 6000;
constexpr int kValidationPerTask = 6, kGoldenWindows = 8;
constexpr double kAgreement = 1e-4;  // between libtorch's plans and those of inference

std::string line(const DstarProgress& progress) {
  return fmt::format(
      "step {:>6} of {}, {:>4.0f} windows/s, {} left; loss {:.4f} (action {:.4f}, phase {:.4f}, auxiliary {:.4f}), "
      "validation {:.4f}, phase accuracy {:.1f} %",
      progress.step, progress.steps, progress.windows_per_second, format_duration(std::max(0.0, progress.seconds_left)),
      progress.loss, progress.action, progress.phase, progress.auxiliary, progress.validation,
      100.0 * progress.phase_accuracy);
}

struct Stopped {};  // by the user, while demonstrations are made: nothing is kept

bool stop_asked() { return interrupt() != Interrupt::kNone; }

// Made once per folder and kept there: hours of frames take minutes.
std::shared_ptr<const DemonstrationSet> demonstrations(Session& session, const std::shared_ptr<const RobotModel>& robot,
                                                       const DemonstrationOptions& options, const std::string& file) {
  if (!fs::exists(file)) {
    Progress progress(session.progress());
    const std::optional<DemonstrationSet> made = make_demonstrations(robot, options, progress, stop_asked);
    if (!made) throw Stopped();
    fs::create_directories(fs::path(file).parent_path());
    save_demonstrations(*made, file);
  }
  return std::make_shared<const DemonstrationSet>(load_demonstrations(file, robot->digest, origin_of(options)));
}

DstarData data_of(Session& session, const DstarArguments& arguments) {
  DstarData data;
  data.robot = load_shared_robot();
  data.language = arguments.language.empty() ? built_in_language() : load_language_table(arguments.language);
  const fs::path folder = fs::path(arguments.run.folder) / "data";
  data.train = demonstrations(session, data.robot, arguments.data, (folder / "train.safetensors").string());
  DemonstrationOptions held = arguments.data;
  held.seed = kValidationSeed;
  for (DemonstrationClips& kind : held.clips) kind.per_task = std::min(kind.per_task, kValidationPerTask);
  held.starts = 1;
  data.validation = demonstrations(session, data.robot, held, (folder / "validation.safetensors").string());
  const std::string split =
      arguments.split.empty() ? share_file("test split", "policies/dstar/test_split.txt") : arguments.split;
  const std::vector<std::string> digests = load_split(split);
  check_held_out(*data.train, digests, split);
  check_held_out(*data.validation, digests, split);
  return data;
}

std::string round_file(const DstarRun& run, int round) {
  return (fs::path(run.folder) / run.name / fmt::format("round-{}.safetensors", round)).string();
}

// Adds what is seen where the network of now takes the robot.
void add_round(Session& session, const DstarArguments& arguments, int round, DstarData& data) {
  DemonstrationOptions options = arguments.data;
  options.policy = "dstar";
  options.followed = arguments.round_clips;
  options.policy_options = {{"network", dstar_network_file(arguments.run)}};
  if (!arguments.language.empty()) options.policy_options["language"] = arguments.language;
  const auto more = demonstrations(session, data.robot, options, round_file(arguments.run, round));
  auto both = std::make_shared<DemonstrationSet>(*data.train);
  both->append(*more);
  data.train = std::move(both);
}

// A small training whose outcome can be checked in minutes.
void make_small(DstarArguments& arguments) {
  arguments.data.clips = {{Likeness::kPeople, 12}};
  arguments.data.starts = 1;
  arguments.data.engine = "";
  arguments.rounds = 0;
  DstarRun& run = arguments.run;
  run.config.width = 64;
  run.config.layers = 1;
  run.config.channels = 64;
  run.batch = 64;
  if (run.steps == DstarRun{}.steps) run.steps = 300;
  run.validate_every = static_cast<int>(std::max(1L, run.steps / 10));  // the first of a network that knows nothing yet
  run.patience = 0;
}

// Settles the options that depend on the machine and on other options.
void settle(DstarArguments& arguments) {
  arguments.run.threads = arguments.data.threads = arguments.threads.value_or(default_threads());
  arguments.data.leads = arguments.start == TrainingStart::kLead;
  arguments.data.answers = arguments.data.leads || arguments.start == TrainingStart::kAnswer;
  if (arguments.start != TrainingStart::kSimToReal) return;
  arguments.data.start = StartMode::kSimToReal;
  arguments.data.starts = 1;  // they are all the same
}

// Checks the learnt network as the program will run it.
void check_network(const Session& session, const DstarData& data, const DstarRun& run) {
  const std::string file = dstar_network_file(run);
  const double difference = runner_difference(data, run, file, kGoldenWindows);
  require(difference <= kAgreement,
          "{}: plans of inference and of libtorch differ by {:.2e}, expected at "
          "most {:.0e}",
          file, difference, kAgreement);
  note(session, fmt::format("{}: inference agrees with libtorch within {:.1e}", file, difference));
}

void train(Session& session, DstarArguments& arguments, const std::string& name) {
  need_dstar_trainer();
  set_variant(arguments.run, name);
  if (!arguments.config.empty())
    arguments.run.config = parse_dstar_config(read_text(arguments.config), arguments.config);
  if (arguments.smoke) make_small(arguments);
  DstarData data = data_of(session, arguments);
  if (!arguments.from.empty()) arguments.run.from = load_dstar_network(arguments.from, *data.robot);
  double first = -1.0, last = 0.0, accuracy = 0.0, speed = 0.0;
  const auto report = [&](const DstarProgress& progress) {
    if (first < 0.0 && progress.validation > 0.0) first = progress.validation;
    last = progress.validation;
    accuracy = progress.phase_accuracy;
    speed = progress.windows_per_second;
    note(session, line(progress));
  };
  const int rounds = arguments.data.engine.empty() ? 0 : arguments.rounds;
  for (int round = 0; round <= rounds; ++round) {
    DstarRun part = arguments.run;
    part.until = part.steps * (round + 1) / (rounds + 1);
    if (train_dstar(data, part, report, stop_asked) == DstarEnd::kStopped) throw Stopped();
    if (round < rounds) add_round(session, arguments, round, data);
  }
  check_network(session, data, arguments.run);
  if (arguments.smoke && last >= first) {
    note(session, fmt::format("smoke test failed: the validation loss went from {:.4f} to {:.4f}, expected it to fall",
                              first, last));
    session.exit_code = kExitGate;
  }
  const std::string file = dstar_network_file(arguments.run);
  print(session, fmt::format("{}\n", file),
        {{"network", file}, {"validation", last}, {"phase_accuracy", accuracy}, {"windows_per_second", speed}});
}

// No training: windows of the same demonstrations, as they are.
void make_library(Session& session, DstarArguments& arguments, const std::string& name) {
  const DstarData data = data_of(session, arguments);
  const fs::path file = fs::path(arguments.run.folder) / name / "library.safetensors";
  fs::create_directories(file.parent_path());
  save_retrieval_library(file.string(),
                         make_retrieval_library(data.robot, *data.train, kLibraryWindows, arguments.run.seed));
  print(session, fmt::format("{}\n", file.string()), {{"library", file.string()}});
}

void train_or_stop(Session& session, DstarArguments& arguments, const std::string& name) {
  catch_interrupts();
  settle(arguments);
  try {
    name == kRetrieval ? make_library(session, arguments, name) : train(session, arguments, name);
  } catch (const Stopped&) {
    note(session, fmt::format("stopped; the same command goes on from what is in '{}'", arguments.run.folder));
    session.exit_code = interrupt() == Interrupt::kInterrupted ? kExitInterrupted : kExitResumable;
  }
}

void add_policy(CLI::App& train_command, Session& session, const std::string& name) {
  auto arguments = std::make_shared<DstarArguments>();
  const std::string about =
      name == "dstar" ? "D-STAR (supplement A.2, A.3.1): demonstrations made here, then supervised training.\n"
                        "Killed or stopped, the same command goes on from the last checkpoint"
                      : fmt::format("The variant '{}' of D-STAR, on the same demonstrations", name);
  CLI::App* command =
      add_command(train_command, session, name, about, fmt::format("duet train {} --smoke -o runs/smoke", name));
  add_fields<PolicyTraining>(*command, policy_training_fields(), *arguments, "clips");
  command->add_flag("--smoke", arguments->smoke,
                    "a small training in minutes; fails (exit 1) where the validation loss does not fall");
  command->callback([&session, arguments, name] { train_or_stop(session, *arguments, name); });
}

void add_pack(CLI::App& train_command, Session& session) {
  auto from = std::make_shared<std::string>(), to = std::make_shared<std::string>();
  CLI::App* command =
      add_command(train_command, session, "pack", "Write a policy's network in half precision, to ship it",
                  "duet train pack runs/policies/dstar/network.safetensors -o dstar.safetensors");
  command->add_option("network", *from, "file of a training")->required();
  command->add_option("-o,--output", *to, "file to write")->required();
  command->callback([&session, from, to] {
    const auto robot = load_shared_robot();
    save_dstar_network(*to, *load_dstar_network(*from, *robot), TensorType::kF16);
    load_dstar_network(*to, *robot);  // its golden plan is checked
    print(session, fmt::format("{}: {} bytes\n", *to, fs::file_size(*to)), {{"network", *to}});
  });
}

void add_split(CLI::App& train_command, Session& session) {
  auto file = std::make_shared<std::string>();
  CLI::App* command =
      add_command(train_command, session, "split", "Print the test split of a suite: a digest and a name per clip",
                  "duet train split suites/core.yaml > policies/dstar/test_split.txt");
  command->add_option("suite", *file, "suite file, or the name of one that ships")->required();
  command->callback([&session, file] {
    Progress progress(session.progress());
    const std::string text = split_text(load_suite(suite_file(*file)), default_threads(), progress);
    print(session, text, {{"split", text}});
  });
}

}  // namespace

void add_train_dstar(CLI::App& train_command, Session& session) {
  for (const std::string& name : dstar_variants()) add_policy(train_command, session, name);
  add_policy(train_command, session, kRetrieval);
  add_pack(train_command, session);
  add_split(train_command, session);
}

}  // namespace duet::cli
