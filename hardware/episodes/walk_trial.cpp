#include "duet/hardware/episodes/walk_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/numbers.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/twin/lock_step.h"

namespace duet {
namespace {

constexpr double kWalksFrom = 9.5;  // of the twin's time: let down, and told to run [s]
constexpr double kStandsFor = 2.0;  // told to stand, until the trial ends [s]
constexpr double kFence = 5.0;      // half the box that it may walk in [m]

GuardSetup setup_of_walks() {
  RobotConfig config;
  config.twin = true;
  config.person = false;
  config.permission.mode_machine = TwinOptions{}.mode_machine;
  config.limits.fence_x = config.limits.fence_y = kFence;
  return guard_setup(config, false);
}

bool is_told_to_stand(const VelocityCommand& root) {
  return root.forward == 0.0 && root.lateral == 0.0 && root.yaw_rate == 0.0;
}

class WalkRun {
 public:
  WalkRun(const WalkTrialSetup& setup, std::unique_ptr<Walker> walker, std::uint64_t seed)
      : setup_(setup),
        robot_(load_shared_robot()),
        guard_setup_(setup_of_walks()),
        law_(OdometrySource::kTwin, guard_setup_.limiter.limits,
             walker != nullptr ? walker->least_steps() : LeastSteps{}),
        link_(guard_setup_, noisy_twin(setup.noise, setup.engine, seed), std::move(walker), nullptr) {
    plan_.command.q = robot_->neutral;
  }

  WalkTrial run(const WalkGoal& goal) {
    const VelocityCommand stand{0.0, 0.0, 0.0, HardwareLimits{}.height};
    while (time() < kWalksFrom) plan(stand);
    if (state() != SafetyState::kRun)
      throw std::runtime_error(
          fmt::format("walk trial: expected a twin that runs by {:.1f} s, it is at {}", kWalksFrom, place()));
    begin_ = link_.twin().root();
    const Eigen::Rotation2Dd along(yaw_of(begin_.R) + goal.direction);
    way_ = along * Eigen::Vector2d::UnitX();
    goal_.X_WB.p << begin_.p.head<2>() + goal.distance * way_, HardwareLimits{}.height;
    goal_.X_WB.R = yaw_rotation(yaw_of(begin_.R) + goal.heading);
    result_.beyond = -goal.distance;
    double stood_since = time();
    while (time() < kWalksFrom + setup_.most_seconds && !result_.fell && !result_.held && !result_.stands) {
      const OdometrySample odometry{report_.robot.X_WB, report_.robot.v_WB, report_.odometry_at, report_.odometry};
      const VelocityCommand root = law_.update(odometry, goal_, report_.now);
      plan(root);
      note(goal.distance);
      if (!is_told_to_stand(root)) stood_since = time();
      result_.stands = time() - stood_since > kStandsFor;
    }
    result_.seconds = time() - kWalksFrom;
    const Pose& end = link_.twin().root();
    result_.off = (end.p - goal_.X_WB.p).head<2>().norm();
    result_.turned_off = std::abs(std::remainder(yaw_of(end.R) - yaw_of(goal_.X_WB.R), 2.0 * std::numbers::pi));
    return result_;
  }

 private:
  [[nodiscard]] double time() { return link_.twin().time(); }
  [[nodiscard]] SafetyState state() const { return link_.guard().status().safety.state; }
  [[nodiscard]] std::string place() const {
    return fmt::format("{} ({})", safety_state_name(state()), stop_cause_name(link_.guard().status().safety.cause));
  }

  void plan(const VelocityCommand& root) {
    plan_.command.root = root;
    plan_.command.stamp = time();
    ++plan_.sequence;
    link_.send(plan_);
    link_.next(report_);
  }

  void note(double distance) {
    const Eigen::Vector2d gone = (link_.twin().root().p - begin_.p).head<2>();
    result_.beyond = std::max(result_.beyond, gone.dot(way_) - distance);
    if (link_.twin().physics() != nullptr) result_.fell = has_fallen(link_.twin().physics()->state(), robot_->fall);
    result_.held = state() != SafetyState::kRun;
    if (result_.held) result_.said = place();
  }

  WalkTrialSetup setup_;
  std::shared_ptr<const RobotModel> robot_;
  GuardSetup guard_setup_;
  RootVelocity law_;
  TwinInProcess link_;
  PlannerMessage plan_;
  GuardReport report_;
  Pose begin_;
  Eigen::Vector2d way_ = Eigen::Vector2d::UnitX();
  Reference goal_;
  WalkTrial result_;
};

}  // namespace

WalkGoal random_goal(double nearest, double furthest, std::uint64_t seed) {
  Random random(seed, stream_key({"walk trial"}));
  WalkGoal goal;
  goal.distance = random.uniform(nearest, furthest);
  goal.direction = random.uniform(-std::numbers::pi, std::numbers::pi);
  goal.heading = random.uniform(-std::numbers::pi, std::numbers::pi);
  return goal;
}

WalkTrial run_walk_trial(const WalkGoal& goal, const WalkTrialSetup& setup, std::unique_ptr<Walker> walker,
                         std::uint64_t seed) {
  return WalkRun(setup, std::move(walker), seed).run(goal);
}

}  // namespace duet
