// One robot in MuJoCo that learns to track: observations, rewards and ends of A.3.2. Deterministic from (seed, index):
// what other environments or threads do has no part in it. One owner, not thread-safe.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "duet/backends/backend.h"
#include "duet/controllers/wbc_sim/observation.h"
#include "duet/controllers/wbc_sim/tracker.h"
#include "duet/controllers/wbc_sim/wbc_sim.h"
#include "duet/core/numbers.h"
#include "duet/rollout/reference_source.h"
#include "duet/training/wbc_task.h"

namespace duet {

enum class EpisodeEnd { kNone, kFell, kTimeUp };

// Sums over ticks, to be divided by `ticks`; what the log shows.
struct TrackingStatistics {
  long ticks = 0;
  double root_xy = 0.0;     // [m]
  double heading = 0.0;     // angle of the pelvis to its reference [rad]
  double upper_body = 0.0;  // rms over keypoints [m]
  double joints = 0.0;      // mean |q - ref| of the upper body [rad]
  double action_rate = 0.0;
  double clock = 0.0;       // share of feet where the clock has them, while stepping
  double swing_lift = 0.0;  // highest point of each swing, summed [m]
  long stepping_ticks = 0, swings = 0;
  void add(const TrackingStatistics& other);
};

struct Transition {
  double reward = 0.0;
  EpisodeEnd end = EpisodeEnd::kNone;
};

class WbcEnvironment {
 public:
  // Throws what make_backend, WbcTracker and ReferenceStream throw.
  WbcEnvironment(std::shared_ptr<const RobotModel> robot, const WbcTask& task, std::uint64_t seed, int index);

  [[nodiscard]] int actor_size() const { return layout_.oracle(); }
  [[nodiscard]] int critic_size() const { return layout_.critic(static_cast<int>(links_.size())); }
  [[nodiscard]] int actions() const { return layout_.joints(); }

  void reset();
  void observe(std::span<float> actor, std::span<float> critic) const;
  // Acts for one tick; the caller resets after an end. The action is clipped to +-4.
  Transition step(std::span<const float> action);

  [[nodiscard]] const WbcSensors& sensors() const { return sensors_; }
  [[nodiscard]] const Eigen::VectorXf& action() const { return action_; }  // the last one
  [[nodiscard]] int tick() const { return tick_; }
  void skip_to(int tick) { tick_ = tick; }  // so that episodes of a batch do not end together
  TrackingStatistics take_statistics();

 private:
  void renew_body();
  void draw_gains();
  RobotState draw_start();
  void disturb();
  const Reference& show_reference();
  void push();
  void apply(std::span<const float> action);
  void read_contacts();
  void look();
  [[nodiscard]] bool fell() const;
  double reward();
  double tracking_reward();
  double stepping_reward();
  double standing_reward() const;
  double effort();
  [[nodiscard]] double stance_penalty() const;
  [[nodiscard]] Eigen::Vector2d carried() const;
  [[nodiscard]] Eigen::Vector2d foothold(int side) const;

  std::shared_ptr<const RobotModel> nominal_;
  WbcTask task_;
  Random random_;
  std::unique_ptr<Backend> backend_;
  int steps_of_body_ = 0;
  ReferenceStream stream_;
  WbcTracker tracker_;
  WbcLayout layout_;
  Kinematics actual_, wanted_;
  std::vector<int> links_;
  std::array<int, 2> feet_{};
  std::vector<int> keypoints_;
  std::array<int, 2> hands_{};
  std::vector<int> push_links_;
  Eigen::VectorXd scale_;  // of the action, per joint [rad]
  JointCommand command_, late_;
  Eigen::VectorXf action_, last_action_, second_last_;
  WbcSensors sensors_;
  int tick_ = 0, latency_ = 0, push_ticks_ = 0, pushed_ = -1;
  bool is_pushed_ = false, jumps_ = false;  // in this episode: the robot (instead of kicks), its reference
  Reference shown_;                         // the stream's reference, off by X_jump_
  Pose X_jump_;
  double kick_in_ = 0.0;
  std::array<bool, 2> on_ground_{};
  std::array<double, 2> lift_{}, top_{};
  bool touches_itself_ = false;
  Eigen::Matrix<double, 3, 2> feet_before_ = Eigen::Matrix<double, 3, 2>::Zero();  // ankles a tick ago
  TrackingStatistics statistics_;
};

// The report of one iteration of a training of WBC-Sim: of the oracle's PPO and of the student's distillation.
struct IterationReport {
  long iteration = 0, steps = 0;  // of the environment, from the training's beginning
  int episodes = 0, falls = 0;
  double episode_seconds = 0.0, episode_return = 0.0;  // oracle: mean over the episodes that ended
  double rate = 0.0;                                   // of learning
  double divergence = 0.0, std = 0.0;                  // oracle
  double loss = 0.0;                                   // student: mean squared difference of an action
  TrackingStatistics tracking;
};

}  // namespace duet
