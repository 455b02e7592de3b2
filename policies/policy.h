// A policy: what it sees of itself and the partner -> five anchors over the next two seconds, at 5 Hz (supplement
// A.3.1, F).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/episode_facts.h"
#include "duet/core/recording.h"
#include "duet/core/robot_state.h"
#include "duet/core/task.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The five anchors of a plan, and the 50 Hz references between them (supplement F, Algorithm 8).

inline constexpr int kAnchors = 5;             // at t + {0, 0.5, 1, 1.5, 2} s
inline constexpr double kAnchorSpacing = 0.5;  // [s]
inline constexpr int kTicksPerAnchor = 25;
inline constexpr int kTicksPerPlan = 10;  // 5 Hz on the 50 Hz clock

using Anchors = std::array<Reference, kAnchors>;

// Algorithm 8: anchors of a call -> 100 references on the 50 Hz grid, i/50 s after the call. Positions and joints
// linear, rotation slerp.
std::vector<Reference> densify(const Anchors& anchors);

// Positions and joints linear, rotation slerp (shorter arc); s = 0 gives a to the bit.
Reference interpolate(const Reference& a, const Reference& b, double s);

inline constexpr int kHistoryFrames = 12;     // observation history, the current frame included, at 50 Hz
inline constexpr int kObservationSize = 149;  // human root 3, SMPL joints 72, robot 74 (supplement A.2.1)

// One frame as sensed. The 149-D vector of supplement A.2.1 is built from it by to_vector.
struct ObservationFrame {
  Eigen::Matrix<double, 3, kSmplJoints> partner;  // SMPL-24 joints [m], frame W; column 0 is the root
  RobotState robot;
};

// Named layout: human root (3), human joints (72), base linear and angular velocity in B (3 + 3), gravity in B (3), q,
// v (n each), root translation since the episode's start (3), root orientation wxyz (4): 149 for 29 joints.
Eigen::VectorXd to_vector(const ObservationFrame& frame, const Eigen::Vector3d& start_position);

struct Observation {
  std::span<const ObservationFrame> history;  // oldest first, kHistoryFrames entries (the first repeated at the start)
  int tick = 0;                               // 50 Hz ticks since the episode's start
  [[nodiscard]] const ObservationFrame& now() const { return history.back(); }
};

// Whether every number of it is.
bool is_finite(const Observation& observation);

// w, x, y, z with w >= 0: q and -q are one orientation.
Eigen::Vector4d wxyz_of(const Eigen::Quaterniond& R);

// The facts that a policy may know when an episode starts. Only `replay` looks at `hindsight`.
struct EpisodeContext {
  Task task = Task::kHug;
  std::string prompt;  // the language command
  RobotState start;
  const RobotMotion* hindsight = nullptr;  // the reference motion of this episode at 50 Hz, frame 0 = tick 0
  std::uint64_t seed = 0;
  std::function<bool()> stop_asked = {};  // asked while a policy waits for a program; true: give up, no fault
};

// Counts a plan of `policy` that is left out; returns no plan.
std::vector<Reference> leave_out(PolicyFaults& faults, std::string_view policy, int tick, std::string_view problem);

// Throws MissingError, which names policy and tasks, unless it was made for the task: its episode is `unsupported`.
void require_known_task(std::string_view policy, std::span<const Task> known, Task task);

class Policy {
 public:
  virtual ~Policy() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  // Throws MissingError for a task that it was not made for.
  virtual void reset(const EpisodeContext& context) = 0;
  // Anchors at observation.tick / 50 + {0, ..., 2} s.
  virtual Anchors act(const Observation& observation) = 0;
  // The plan for the scheduler: references at observation.tick + {0, 1, ...} ticks. Algorithm 8 on act(), unless a
  // policy knows more than its anchors can say: half a second between anchors leaves 75 % of a swing of 0.5 Hz and 23 %
  // of one of 1 Hz (docs/deviations.md). Empty: no plan this time (see PolicyFaults).
  virtual std::vector<Reference> plan(const Observation& observation);
  // A correction that cannot wait for the next plan: a policy that corrects has, at every tick, once its plans are
  // fused, the last word on the reference that the controller gets (policies/hand_servo.h).
  [[nodiscard]] virtual bool corrects() const { return false; }
  virtual void correct(const Observation&, Reference&) {}
  [[nodiscard]] virtual PolicyFaults faults() const { return {}; }  // since reset
};

// The options that a suite may set of one policy, by name ("network", "prompt", ...); values as written there.
using PolicyOptions = std::map<std::string, std::string>;

struct PolicyOption {
  std::string name, fallback, about;  // fallback: the value that holds where none is given
};

struct PolicyInfo {
  std::string name;
  std::string about;  // one sentence for `duet list policies`
  std::vector<PolicyOption> options;
};

// Makes one policy per episode of what it has loaded once. Thread-safe.
using PolicyMaker = std::function<std::unique_ptr<Policy>()>;

// The last kHistoryFrames frames that a policy sees, the first one repeated until there are as many. One owner, not
// thread-safe.

class ObservationHistory {
 public:
  void reset() { empty_ = true; }
  // The frame of the current tick.
  void add(const ObservationFrame& frame);
  // Refers to this history: valid until the next add. Throws std::invalid_argument before the first add.
  [[nodiscard]] Observation at(int tick) const;

 private:
  std::array<ObservationFrame, kHistoryFrames> frames_;  // oldest first
  bool empty_ = true;
};

// The network's view of a history: to_vector of each frame, (149, kHistoryFrames) for 29 joints, oldest first.
Eigen::MatrixXd to_matrix(const Observation& observation, const Eigen::Vector3d& start_position);

// A policy that was made for one robot, on another whose joints have the same names: HOMIE's G1, whose waist and hands
// are locked. The policy sees joints that the body lacks at neutral and at rest, and what it wants of them is left out.

// Throws std::invalid_argument where the two have no joint in common.
std::unique_ptr<Policy> on_other_body(std::unique_ptr<Policy> policy, std::shared_ptr<const RobotModel> made_for,
                                      const RobotModel& body);

}  // namespace duet
