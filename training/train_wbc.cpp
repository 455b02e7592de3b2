#include "duet/training/train_wbc.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "duet/controllers/stance.h"
#include "duet/core/file.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/training/threads.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr double kFirstStd = 0.6;  // of an action; training leaves it near this
constexpr long kCriticAlone = 40;  // iterations
constexpr const char* kWbcColumns =
    "steps,minutes,return,falls,episode_s,root_xy_m,attitude_rad,upper_body_m,joints_rad,"
    "action_rate,clock,lift_m,rate,std,loss\n";

std::string file_of(const std::string& folder, const std::string& stage, const char* name) {
  return (fs::path(folder) / stage / name).string();
}

// The checkpoint that a stage begins with; empty: new weights.
std::string beginning(const WbcRun& run) {
  if (!run.from.empty()) return run.from;
  const auto stage = std::ranges::find(wbc_plan(), run.stage, &WbcStage::name);
  if (stage == wbc_plan().begin()) return "";
  const std::string& before = std::prev(stage)->name;
  std::string checkpoint = wbc_checkpoint(run.folder, before);
  if (!fs::exists(checkpoint))
    throw InputError(
        fmt::format("stage '{}' begins with '{}', which is not there: run stage '{}' first, or name a "
                    "checkpoint with --from",
                    run.stage, checkpoint, before));
  return checkpoint;
}

void check_robot(const TrainingState& state, const RobotModel& robot, const std::string& file) {
  if (state.robot_digest != robot.digest)
    throw InputError(fmt::format("{}: a checkpoint of another robot (digest {}..., '{}' has {}...)", file,
                                 state.robot_digest.substr(0, 12), robot.name, robot.digest.substr(0, 12)));
}

TrainingState state_of_checkpoint(const SafeTensors& tensors, const std::string& file, const RobotModel& robot) {
  TrainingState state = training_state(tensors, file);
  check_robot(state, robot, file);
  return state;
}

TrainingState new_state(const RobotModel& robot, std::uint64_t seed) {
  const WbcLayout layout(robot.dof());
  TrainingState state;
  state.agent = make_agent(layout.oracle(), layout.critic(static_cast<int>(robot.roles.bodies.size())), robot.dof(),
                           kFirstStd, seed);
  return state;
}

// A network as it ships has an actor alone: its critic is new.
TrainingState state_of_network(const std::string& file, const RobotModel& robot, std::uint64_t seed) {
  const WbcNetwork network = load_wbc_network(file, robot);
  if (network.kind != WbcKind::kOracle)
    throw InputError(fmt::format("{}: the network of a student, expected that of an oracle", file));
  TrainingState state = new_state(robot, seed);
  WbcAgent& agent = state.agent;
  agent.actor = network.mlp;
  agent.actor_input.mean = network.mean;
  agent.actor_input.set_deviation(network.deviation);
  agent.actor_input.count = kLongestMemory;
  state.critic_alone = kCriticAlone;
  return state;
}

TrainingState load_beginning(const std::string& file, const RobotModel& robot, std::uint64_t seed) {
  const SafeTensors tensors = read_safetensors(file);
  if (is_wbc_network(tensors)) return state_of_network(file, robot, seed);
  TrainingState state = state_of_checkpoint(tensors, file, robot);
  state.adam = {};
  state.critic_alone = 0;
  return state;
}

TrainingState first_state(const WbcRun& run, const RobotModel& robot) {
  const std::string here = wbc_checkpoint(run.folder, run.stage);
  if (fs::exists(here)) {
    TrainingState state = state_of_checkpoint(read_safetensors(here), here, robot);
    if (state.seed != run.seed)
      throw InputError(fmt::format("{}: a checkpoint of seed {}, asked for is {}: choose another folder", here,
                                   state.seed, run.seed));
    return state;
  }
  const std::string from = beginning(run);
  TrainingState state = from.empty() ? new_state(robot, run.seed) : load_beginning(from, robot, run.seed);
  state.iteration = state.steps = 0;
  state.minutes = 0.0;
  state.stage = run.stage;
  state.robot_digest = robot.digest;
  state.seed = run.seed;
  return state;
}

// Sums what iterations report, and says when it is time to print and to save.
class Log {
 public:
  Log(const WbcRun& run, long steps_before, long steps_wanted)
      : path_(wbc_curves(run.folder, run.stage)), steps_before_(steps_before) {
    progress_.stage = run.stage;
    progress_.steps_wanted = steps_wanted;
    fs::create_directories(fs::path(path_).parent_path());
    if (steps_before == 0 || !fs::exists(path_)) write_file(path_, kWbcColumns);
  }

  void add(const IterationReport& iteration) {
    episodes_ += iteration.episodes;
    falls_ += iteration.falls;
    returns_ += iteration.episode_return * iteration.episodes;
    seconds_ += iteration.episode_seconds * iteration.episodes;
    progress_.tracking.add(iteration.tracking);
  }

  [[nodiscard]] bool report_due() const { return pace_.report_due(); }
  [[nodiscard]] bool save_due() const { return pace_.save_due(); }
  void saved() { pace_.saved(); }

  WbcProgress report(const IterationReport& last, double minutes) {
    const double n = std::max(1, episodes_), elapsed = pace_.seconds();
    progress_.steps = last.steps;
    progress_.steps_per_second = static_cast<double>(last.steps - steps_before_) / std::max(1e-9, elapsed);
    progress_.seconds_left =
        static_cast<double>(progress_.steps_wanted - last.steps) / std::max(1e-9, progress_.steps_per_second);
    progress_.episode_return = returns_ / n;
    progress_.fall_share = falls_ / n;
    progress_.episode_seconds = seconds_ / n;
    progress_.loss = last.loss;
    append(minutes, last.rate, last.std);
    WbcProgress reported = progress_;
    progress_.tracking = {};
    episodes_ = falls_ = 0;
    returns_ = seconds_ = 0.0;
    pace_.reported();
    return reported;
  }

 private:
  void append(double minutes, double rate, double std) const {
    const TrackingStatistics& t = progress_.tracking;
    const double ticks = static_cast<double>(std::max(1L, t.ticks)),
                 stepping = static_cast<double>(std::max(1L, t.stepping_ticks));
    LineAppender(path_).append(fmt::format(
        "{},{:.3f},{:.3f},{:.4f},{:.3f},{:.4f},{:.4f},{:.4f},{:.4f},{:.3f},{:.3f},{:.4f},{:.2e},{:.3f},{:.5f}",
        progress_.steps, minutes, progress_.episode_return, progress_.fall_share, progress_.episode_seconds,
        t.root_xy / ticks, t.heading / ticks, t.upper_body / ticks, t.joints / ticks, t.action_rate / ticks,
        t.clock / stepping, t.swing_lift / static_cast<double>(std::max(1L, t.swings)), rate, std, progress_.loss));
  }

  std::string path_;
  long steps_before_;
  Pace pace_;
  WbcProgress progress_;
  int episodes_ = 0, falls_ = 0;
  double returns_ = 0.0, seconds_ = 0.0;
};

WbcTask task_of(const WbcRun& run) {
  WbcTask task = wbc_stage(find_wbc_stage(run.stage).task);
  task.stream.data = run.motions;
  if (!run.motions || run.motions->empty()) task.stream.motions = 0.0;
  return task;
}

// The loop of a stage; `trainer` is a Ppo or a Distillation.
template <typename Trainer>
bool train_stage(Trainer& trainer, const RobotModel& robot, const WbcRun& run, long steps_wanted,
                 const std::function<void(const WbcProgress&)>& report, const std::function<bool()>& stop) {
  Log log(run, trainer.state().steps, steps_wanted);
  const GaitOptions gait = task_of(run).gait;
  const auto save = [&] {
    write_safetensors(wbc_checkpoint(run.folder, run.stage), to_tensors(trainer.state()));
    save_wbc_network(wbc_network_file(run.folder, run.stage), network_of(robot, gait, trainer.state()),
                     TensorType::kF16);
    log.saved();
  };
  bool stopped = false;
  while (trainer.state().steps < steps_wanted && !(stopped = stop())) {
    const IterationReport iteration = trainer.iterate();
    log.add(iteration);
    if (log.save_due()) save();
    if (log.report_due() || iteration.steps >= steps_wanted) report(log.report(iteration, trainer.state().minutes));
  }
  save();
  return !stopped;
}

Ppo oracle_trainer(const std::shared_ptr<const RobotModel>& robot, const WbcRun& run) {
  const WbcTask task = task_of(run);
  PpoOptions options;
  options.threads = run.threads;
  options.environments = run.environments;
  options.entropy = task.entropy;
  options.largest_std = task.largest_std;
  return {robot, task, options, first_state(run, *robot)};
}

StudentState first_student(const WbcRun& run, const RobotModel& robot) {
  const std::string here = wbc_checkpoint(run.folder, run.stage);
  if (!fs::exists(here)) return make_student(robot.dof(), run.seed);
  StudentState state = student_state(read_safetensors(here), here);
  if (state.seed != run.seed)
    throw InputError(
        fmt::format("{}: a checkpoint of seed {}, asked for is {}: choose another folder", here, state.seed, run.seed));
  return state;
}

Distillation student_trainer(const std::shared_ptr<const RobotModel>& robot, const WbcRun& run, long steps_wanted) {
  DistillOptions options;
  options.threads = run.threads;
  options.environments = run.environments;
  const long rounds = steps_wanted / (static_cast<long>(options.environments) * options.horizon);
  const TrainingState teacher = load_beginning(beginning(run), *robot, run.seed);
  return {robot, task_of(run), options, teacher.agent, first_student(run, *robot), rounds};
}

WbcNetwork named(const RobotModel& robot, const GaitOptions& gait) {
  WbcNetwork network;
  network.gait = gait;
  network.robot = robot.name;
  network.joints = robot.joint_names();
  network.neutral = robot.neutral;
  const JointCommand command = robot.default_command(robot.neutral);
  network.kp = command.kp;
  network.kd = command.kd;
  network.action_scale = action_scale(robot);
  return network;
}

}  // namespace

const std::vector<WbcStage>& wbc_plan() {
  static const std::vector<WbcStage> plan = {
      {.name = "stand", .steps = 5'700'000, .task = "stand"},
      {.name = "walk", .steps = 3'600'000, .task = "walk"},
      {.name = "brace", .steps = 19'000'000, .task = "brace"},
      {.name = "interact", .steps = 8'000'000, .task = "interact", .follows = true},
      {.name = "student", .steps = 4'000'000, .task = "interact", .follows = true, .distils = true}};
  return plan;
}

const WbcStage& find_wbc_stage(const std::string& name) { return entry_named(wbc_plan(), "stage", name); }

std::vector<WbcRun> wbc_runs(const WbcRun& run) {
  std::vector<WbcRun> runs;
  for (const WbcStage& stage : wbc_plan()) {
    WbcRun& next = runs.emplace_back(run);
    next.stage = stage.name;
    if (runs.size() > 1) next.from.clear();
  }
  return runs;
}

std::string wbc_checkpoint(const std::string& folder, const std::string& stage) {
  return file_of(folder, stage, "checkpoint.safetensors");
}
std::string wbc_network_file(const std::string& folder, const std::string& stage) {
  return file_of(folder, stage, "network.safetensors");
}
std::string wbc_curves(const std::string& folder, const std::string& stage) {
  return file_of(folder, stage, "curves.csv");
}

WbcNetwork network_of(const RobotModel& robot, const GaitOptions& gait, const TrainingState& state) {
  WbcNetwork network = named(robot, gait);
  network.kind = WbcKind::kOracle;
  network.mlp = state.agent.actor;
  network.mean = state.agent.actor_input.mean;
  network.deviation = state.agent.actor_input.deviation();
  network.seed = state.seed;
  network.steps = state.steps;
  network.note = fmt::format("oracle, stage {}", state.stage);
  return network;
}

WbcNetwork network_of(const RobotModel& robot, const GaitOptions& gait, const StudentState& state) {
  WbcNetwork network = named(robot, gait);
  network.kind = WbcKind::kStudent;
  network.mlp = state.student;
  network.mean = state.input.mean;
  network.deviation = state.input.deviation();
  network.seed = state.seed;
  network.steps = state.steps;
  network.note = "student";
  return network;
}

bool train_wbc(const std::shared_ptr<const RobotModel>& robot, const WbcRun& run,
               const std::function<void(const WbcProgress&)>& report, const std::function<bool()>& stop) {
  const WbcStage& stage = find_wbc_stage(run.stage);
  require(run.steps >= 0, "train wbc: {} steps, expected a positive number", run.steps);
  const long steps = run.steps > 0 ? run.steps : stage.steps;
  if (stage.distils) {
    Distillation student = student_trainer(robot, run, steps);
    return train_stage(student, *robot, run, steps, report, stop);
  }
  Ppo oracle = oracle_trainer(robot, run);
  return train_stage(oracle, *robot, run, steps, report, stop);
}

}  // namespace duet
