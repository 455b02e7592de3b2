#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "duet/archives/recording_file.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/hardware/log/log_reader.h"
#include "duet/hardware/log/run_log.h"

namespace duet {
namespace {

constexpr int kTicksPerFrame = 10;  // of the guard: 50 Hz

// A tick of the log with what was sent in it.
struct LoggedTick {
  TickRecord record;
  std::optional<LowCommandFrame> sent;
};

// Keeps every tenth tick of the episode in a log.
class EpisodeTicks {
 public:
  LogParts parts() {
    LogParts parts;
    parts.setup = [this](const LimiterSetup& of, const nlohmann::json&) { setup = of; };
    parts.tick = [this](const TickRecord& record) { take(record); };
    parts.command = [this](const LowCommandFrame& frame) {  // of the tick before it in the file
      for (std::vector<LoggedTick>* ticks : latest_) ticks->back().sent = frame;
    };
    parts.event = [this](const LogEvent& event) { take(event); };
    return parts;
  }

  std::optional<LimiterSetup> setup;
  std::vector<LoggedTick> with_goal, any;
  std::vector<std::string> events;
  std::string end_cause;

 private:
  [[nodiscard]] bool runs() const { return state_ == "run" || state_ == "hold"; }

  void take(const TickRecord& record) {
    latest_ = {};
    if (!runs()) return;
    const LoggedTick tick{record, {}};
    keep(tick, runs_++, any);
    if ((record.flags & kTickGoal) != 0) keep(tick, goals_++, with_goal);
  }

  void keep(const LoggedTick& tick, long count, std::vector<LoggedTick>& ticks) {
    if (count % kTicksPerFrame != 0) return;
    ticks.push_back(tick);
    latest_.push_back(&ticks);
  }

  void take(const LogEvent& event) {
    events.push_back(event.text);
    const bool ran = runs();
    state_ = event.state;
    if (ran && !runs()) end_cause = event.cause;
  }

  std::string state_ = "offline";
  std::vector<std::vector<LoggedTick>*> latest_;
  long runs_ = 0, goals_ = 0;
};

Pose pose_from(const double (&values)[7]) {
  return {Eigen::Quaterniond(values[6], values[3], values[4], values[5]).normalized(),
          {values[0], values[1], values[2]}};
}

Eigen::VectorXd vector_from(const double (&values)[kG1Motors]) {
  return Eigen::Map<const Eigen::VectorXd>(values, kG1Motors);
}

RobotState state_from(const TickRecord& record) {
  RobotState state;
  state.X_WB = pose_from(record.root_pose);
  state.X_WB.R = Eigen::Quaterniond(record.tilt[3], record.tilt[0], record.tilt[1], record.tilt[2]).normalized();
  state.v_WB = Eigen::Map<const Eigen::Vector3d>(record.root_velocity);
  state.w_WB_B = Eigen::Map<const Eigen::Vector3d>(record.root_gyro);
  state.q = vector_from(record.q);
  state.v = vector_from(record.v);
  return state;
}

bool is_finite_state(const RobotState& state) {
  return state.X_WB.p.allFinite() && state.X_WB.R.coeffs().allFinite() && state.v_WB.allFinite() &&
         state.w_WB_B.allFinite() && state.q.allFinite() && state.v.allFinite();
}

// Adds the reference and the targets that lead to the next frame.
void add_asked(const LoggedTick& tick, const RobotState& state, Recording& recording) {
  const bool goal = (tick.record.flags & kTickGoal) != 0;
  Pose root = goal ? pose_from(tick.record.goal) : state.X_WB;
  if (!root.p.allFinite() || !root.R.coeffs().allFinite()) root = state.X_WB;
  Eigen::VectorXd asked = vector_from(tick.record.asked_q), sent = vector_from(tick.record.sent_q);
  if (tick.sent)
    for (int j = 0; j < kG1Motors; ++j) sent[j] = static_cast<double>(tick.sent->motor[j].q);
  if (!asked.allFinite()) asked = state.q;
  recording.reference.push_back({root, asked});
  recording.q_target.push_back(sent.allFinite() ? sent : state.q);
}

// A frame without a person has the last one; before the first, the first.
PointTracks people_of(const std::vector<LoggedTick>& ticks, int frames) {
  PointTracks people(frames, kSmplJoints);
  int seen = 0;
  for (int t = 0; t < frames; ++t) {
    if ((ticks[t].record.flags & kTickPerson) != 0) {
      std::copy_n(ticks[t].record.person, std::size(ticks[t].record.person), people.data().data() + 72 * t);
      for (; seen < t; ++seen) people.frame(seen) = people.frame(t);
      seen = t + 1;
    } else if (seen > 0) {
      people.frame(t) = people.frame(t - 1);
      seen = t + 1;
    }
  }
  return seen > 0 ? people : PointTracks();
}

void set_end(const EpisodeTicks& log, Recording& recording) {
  if (recording.outcome != Outcome::kOk || log.end_cause.empty() || log.end_cause == "stop_key") return;
  recording.outcome = Outcome::kError;
  recording.message = fmt::format("the guard ended the run: {}", log.end_cause);
}

}  // namespace

LoggedRun recording_of_log(const std::string& path, std::optional<Task> task) {
  EpisodeTicks log;
  LoggedRun run;
  run.whole = read_run_log(path, log.parts());
  const std::vector<LoggedTick>& ticks = log.with_goal.empty() ? log.any : log.with_goal;
  if (ticks.empty()) throw InputError(fmt::format("{}: expected ticks in which the guard ran, found none", path));
  const RobotModel& robot = *log.setup->robot;
  Recording& recording = run.recording;
  recording.task = task;
  for (const LoggedTick& tick : ticks) {
    const RobotState state = state_from(tick.record);
    if (!is_finite_state(state))
      throw InputError(fmt::format("{}: expected finite states, found others in frame {}", path, recording.frames()));
    recording.robot.push_back(state);
    add_asked(tick, state, recording);
    if (!has_fallen(state, robot.fall)) continue;
    recording.outcome = Outcome::kFell;
    recording.message = fmt::format("the robot fell at {:.2f} s", (recording.frames() - 1) / recording.rate_hz);
    break;
  }
  recording.partner = people_of(ticks, recording.frames());
  set_end(log, recording);
  run.executed = executed_mask(robot, log.setup->executed.joints, true);
  run.events = std::move(log.events);
  return run;
}

void save_logged_run(const Recording& recording, const ExecutedMask& executed, const std::string& path) {
  Npz npz = recording_npz(recording);
  put_executed_mask(executed, npz);
  npz.save(path);
}

}  // namespace duet
