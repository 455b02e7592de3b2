// Where an episode happens: an engine, nothing but the reference itself (playback), a robot behind its guard. The loop
// of rollout.h asks it once a tick, in this order: state, contacts, target, advance.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "duet/backends/backend.h"
#include "duet/core/machine.h"
#include "duet/core/recording.h"
#include "duet/core/robot_state.h"
#include "duet/core/task.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Whether an episode has to end though nothing happened in it: its limit, or somebody asked.

// The two clocks that measure an episode's limit [s]; each may start anywhere.
struct EpisodeClock {
  AwakeTime::Clock wall = monotonic_seconds;
  std::function<double()> computed = thread_computed_seconds;  // of the thread that rolls the episode out
};

// A world that waits instead of computing, or has a small share of a core, may take so many times the limit.
inline constexpr double kWaitingShare = 100.0;

// The limit is on what the thread computes: a process that is stopped, and one of many on a core, loses nothing. One
// thread makes it and looks at it.
class Deadline {
 public:
  // `seconds` from now. Refers to `stop_asked`, which may be empty.
  Deadline(double seconds, const std::function<bool()>& stop_asked, const EpisodeClock& clock)
      : stop_asked_(stop_asked),
        seconds_(seconds),
        computed_(clock.computed),
        begin_(computed_()),
        awake_(clock.wall) {}
  [[nodiscard]] bool stop_asked() const { return stop_asked_ && stop_asked_(); }
  [[nodiscard]] bool passed() { return computed_() - begin_ > seconds_ || awake_.look() > kWaitingShare * seconds_; }
  // The time between pause() and go_on() does not count.
  void pause() {
    static_cast<void>(awake_.look());
    paused_ = computed_();
  }
  void go_on() {
    awake_.skip();
    begin_ += computed_() - paused_;
  }

 private:
  const std::function<bool()>& stop_asked_;
  double seconds_;
  std::function<double()> computed_;
  double begin_, paused_ = 0.0;  // by computed_
  AwakeTime awake_;
};

struct Rollout;

class World {
 public:
  virtual ~World() = default;
  // Puts the robot at the start, or waits until it is there. Throws where it cannot be.
  virtual void begin(const RobotState& start) = 0;
  [[nodiscard]] virtual const RobotState& state() const = 0;
  [[nodiscard]] virtual std::span<const Contact> contacts() const { return {}; }  // of the last physics step
  // The joint targets that are sent for this reference [rad]. Valid until the next call.
  virtual const Eigen::VectorXd& target(const Reference& reference) = 0;
  // The 20 ms of this tick. `partner`: SMPL joints, frame 0 at tick 0; empty: nobody.
  virtual Outcome advance(int tick, const PointTracks& partner, Deadline& deadline) = 0;
  // The partner as the world's own sensors have them by now; null: it has none, and the policy sees the episode's
  // partner.
  [[nodiscard]] virtual const HumanJoints* seen_partner() const { return nullptr; }
  // Whether nobody knows better where the partner is: the recording then has what was seen.
  [[nodiscard]] virtual bool records_what_it_sees() const { return false; }
  // Why it ended the episode; empty: what the outcome says of itself.
  [[nodiscard]] virtual std::string message() const { return ""; }
  // Writes the world's measurements into the rollout.
  virtual void finish(Rollout&) const {}
};

// One control period: the physics steps between two commands of a controller. Every loop of the project (an episode, a
// robot that learns, a test) steps a robot under a controller through it.

// Physics steps of `dt` [s] in a control period of 20 ms, at least one.
inline int steps_per_tick(double dt) { return std::max(1, static_cast<int>(std::lround(kTick / dt))); }

// `command_at(i)` is what the joints receive in step i; `after(i)`, called after each step that went well, returns
// whether to go on (kTimedOut where it does not). Otherwise the outcome of the last step.
template <typename CommandAt, typename After>
Outcome step_control_period(Backend& backend, int steps, const CommandAt& command_at, const After& after) {
  for (int i = 0; i < steps; ++i) {
    const Outcome outcome = backend.step(command_at(i));
    if (outcome != Outcome::kOk) return outcome;
    if (!after(i)) return Outcome::kTimedOut;
  }
  return Outcome::kOk;
}

// The same with one command throughout.
inline Outcome step_control_period(Backend& backend, int steps, const JointCommand& command) {
  return step_control_period(
      backend, steps, [&](int) -> const JointCommand& { return command; }, [](int) { return true; });
}

// A robot without physics: it is where its reference says.

// A robot that is put where a reference says. Its velocities are those of the way there, zero for the first.
class KinematicFollower {
 public:
  KinematicFollower() = default;
  explicit KinematicFollower(const RobotState& start) : state_(start) {}
  // `seconds` after the last one, above 0.
  void go_to(const Reference& reference, double seconds);
  [[nodiscard]] const RobotState& state() const { return state_; }

 private:
  RobotState state_;
  bool moved_ = false;
};

// A motion without physics: a robot that is frame by frame where the motion has it.

// A motion as it is, frame for frame, beside a partner (as many frames, or nobody). Throws std::invalid_argument for
// fewer than 2 frames and for a partner of another number of frames.
Recording play_back(const RobotMotion& motion, const PointTracks& partner, std::optional<Task> task,
                    const Phases& phases, const std::shared_ptr<const RobotModel>& robot);

}  // namespace duet
