// A robot behind its guard as the world of an episode (rollout/world.h): the reference's root becomes a velocity by the
// law of supplement A.4.3, its joints targets, both go to the guard, and what the guard reports is the state. The world
// is laid so that the episode's start is where the robot stands. One owner, one thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "duet/hardware/guard_link.h"
#include "duet/hardware/root_velocity.h"
#include "duet/rollout/rollout.h"

namespace duet {

// Where the person's joints are, in the frame of the episode, at a tick of it [m]; false where nobody sees them now.
using PartnerSource = std::function<bool(int tick, HumanJoints& joints)>;
// A person who is where the clip has them, as an estimator sees them 30 times a second. Refers to it.
PartnerSource partner_of_clip(const PointTracks& partner);

struct GuardedEpisode {
  OdometrySource odometry = OdometrySource::kTwin;
  HardwareLimits limits;
  double steps_from = 0.0;         // of the walking controller: RootVelocity
  std::vector<int> joints;         // that the guard's limiter moves: what is executed of the reference beside the root
  int act_begin = 0, act_end = 0;  // ticks in which the task's parts may touch
  PartnerSource person = {};       // empty: the guard hears of nobody
  double most_wait = 30.0;         // for the guard to run, by its clock [s]
  std::function<void(const GuardReport&)> watch = {};  // of each change of state, for displays
};

class GuardedWorld final : public World {
 public:
  // Throws as RootVelocity does. Refers to the link.
  GuardedWorld(GuardedEpisode episode, std::shared_ptr<const RobotModel> robot, GuardLink& link);

  // Plans to stand until the guard runs. Throws std::runtime_error, with what the guard is at, where it does not in
  // most_wait of its time, and where it has gone.
  void begin(const RobotState& start) override;
  [[nodiscard]] const RobotState& state() const override { return state_; }
  // The targets that are sent; for the executed joints those that are asked for, before the limiter.
  const Eigen::VectorXd& target(const Reference& reference) override;
  // A guard that has gone or ended the run is kError, a robot that fell kFell; while it holds, the episode goes on.
  Outcome advance(int tick, const PointTracks& partner, Deadline& deadline) override;
  [[nodiscard]] std::string message() const override { return message_; }

  // Plans to stand for so long after the episode [s]; then whoever is next may have the robot.
  void rest(double seconds);

  // Counts over the episode's ticks.
  [[nodiscard]] int held_ticks() const { return held_ticks_; }  // the guard held
  [[nodiscard]] const ClampCounts& clamps() const { return clamps_; }
  [[nodiscard]] int missed_reports() const { return missed_; }         // that were lost between two
  [[nodiscard]] double began_at() const { return began_at_; }          // by the guard's clock [s]
  [[nodiscard]] const GuardReport& report() const { return report_; }  // the last

 private:
  bool next();
  void plan(const VelocityCommand& root, const Eigen::VectorXd& q, bool acting);
  void show_person(int tick);
  void take_state();
  void lay_world(const Pose& start);
  [[nodiscard]] Pose to_odometry(const Pose& X_EB) const;

  GuardedEpisode episode_;
  std::shared_ptr<const RobotModel> robot_;
  GuardLink& link_;
  RootVelocity velocity_;
  FallRule fall_;
  // Pose of the episode's frame E in odometry's frame O: a turn about z and a shift on the ground.
  double yaw_OE_ = 0.0;
  Eigen::Vector3d p_OE_ = Eigen::Vector3d::Zero();
  RobotState state_;  // frame E
  GuardReport report_;
  PlannerMessage message_to_guard_;
  PersonMessage person_;
  Eigen::VectorXd target_;
  int tick_ = 0;
  SafetyState last_state_ = SafetyState::kOffline;
  ClampCounts clamps_before_{}, clamps_{};
  int held_ticks_ = 0, missed_ = 0;
  double began_at_ = 0.0;
  std::string message_;
};

}  // namespace duet
