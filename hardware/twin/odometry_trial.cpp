#include "duet/hardware/twin/odometry_trial.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/numbers.h"
#include "duet/core/robot_state.h"
#include "duet/hardware/wire/odometry_source.h"
#include "duet/robots/dynamics.h"
#include "duet/rollout/rollout.h"

namespace duet {
namespace {

constexpr int kStepsOfTick = 10;
constexpr std::size_t kTicksOfWay = 10;

Scene flat_ground(const std::shared_ptr<const RobotModel>& robot) {
  Scene scene;
  scene.robot = robot;
  scene.partner = PartnerMode::kNone;
  scene.dt = kTick / kStepsOfTick;
  return scene;
}

StreamOptions walk_of(const OdometryTrial& trial) {
  StreamOptions options;
  options.moves_upper_body = false;
  options.from_neutral = true;
  options.script = ScriptedCommand{.velocity = trial.velocity, .begin = 1.0, .end = trial.seconds, .pause = 0.0};
  return options;
}

// The state as joint encoders and IMU would measure it.
RobotState measured(const RobotState& state, const OdometryTrial& trial, Random& random) {
  RobotState seen = state;
  for (double& q : seen.q) q += trial.joint_noise * random.normal();
  for (double& v : seen.v) v += trial.joint_speed_noise * random.normal();
  for (double& w : seen.w_WB_B) w += trial.gyro_noise * random.normal();
  const Eigen::Vector3d tilt(trial.tilt_noise * random.normal(), trial.tilt_noise * random.normal(), 0.0);
  if (tilt.norm() > 0.0) seen.X_WB.R = state.X_WB.R * Eigen::AngleAxisd(tilt.norm(), tilt.normalized());
  return seen;
}

Eigen::Vector3d measured_force(Eigen::Vector3d force, const OdometryTrial& trial, Random& random) {
  for (double& axis : force) axis += trial.force_bias + trial.force_noise * random.normal();
  return force;
}

// Compares what the legs say with where the base is.
class OdometryComparison {
 public:
  explicit OdometryComparison(const RobotState& start) : begin_(start.X_WB.p) {}

  void add(const RobotState& state, const OdometrySample& sample) {
    const Eigen::Vector3d off = sample.X_WB.p - state.X_WB.p + Eigen::Vector3d(begin_.x(), begin_.y(), 0.0);
    error_.end = off.head<2>().norm();
    error_.largest = std::max(error_.largest, error_.end);
    error_.height = std::max(error_.height, std::abs(off.z()));
    squares_ += (sample.v_WB - state.v_WB).head<2>().squaredNorm();
    ++count_;
  }
  [[nodiscard]] OdometryError error() const {
    OdometryError error = error_;
    if (count_ > 0) error.speed_rms = std::sqrt(squares_ / static_cast<double>(count_));
    return error;
  }

 private:
  Eigen::Vector3d begin_;
  OdometryError error_;
  double squares_ = 0.0;
  long count_ = 0;
};

// An engine whose robot carries the odometry along: after each step it is told what joints and IMU say.
class Measured final : public Backend {
 public:
  Measured(const OdometryTrial& trial, const Scene& scene)
      : Backend(scene),
        engine_(make_backend(trial.engine, scene)),
        trial_(trial),
        random_(trial.seed, stream_key({"odometry trial"})),
        odometry_(scene.robot) {}

  [[nodiscard]] std::string_view name() const override { return engine_->name(); }
  [[nodiscard]] std::string version() const override { return engine_->version(); }
  // Since the last reset; there has been one.
  [[nodiscard]] OdometryError error() const { return comparison_->error(); }

 private:
  void do_reset() override {
    engine_->reset(state_);
    comparison_.emplace(state_);
    odometry_.update(measured(state_, trial_, random_), {0.0, 0.0, kGravity});
    periods_ = 0;
  }
  Outcome do_step(const JointCommand& command) override {
    const Eigen::Vector3d v_before = state_.v_WB;
    const Outcome outcome = engine_->step(command);
    state_ = engine_->state();
    contacts_.assign(engine_->contacts().begin(), engine_->contacts().end());
    torques_ = engine_->torques();
    const Eigen::Vector3d a_W = (state_.v_WB - v_before) / scene().dt + kGravity * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d force = measured_force(state_.X_WB.R.conjugate() * a_W, trial_, random_);
    const RobotState seen = measured(state_, trial_, random_);
    ++periods_;
    if (trial_.lost <= 0.0 || random_.uniform() >= trial_.lost) {
      odometry_.update(seen, force, static_cast<double>(periods_));
      periods_ = 0;
    }
    comparison_->add(state_, odometry_.sample());
    return outcome;
  }
  void do_set_partner(const HumanJoints& joints, const HumanJoints& velocities) override {
    engine_->set_partner(joints, velocities);
  }
  void do_push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) override {
    engine_->push(link, f_W, p_W);
  }
  void do_kick(const Eigen::Vector3d& dv_W) override { engine_->kick(dv_W); }
  void do_snapshot(Snapshot& snapshot) const override {
    const Snapshot inner = engine_->snapshot();
    snapshot.values.insert(snapshot.values.end(), inner.values.begin(), inner.values.end());
  }
  void do_restore(std::span<const double> values) override {
    engine_->restore({std::vector<double>(values.begin(), values.end())});
    state_ = engine_->state();
  }

  std::unique_ptr<Backend> engine_;
  const OdometryTrial& trial_;
  Random random_;
  LegOdometry odometry_;
  int periods_ = 0;  // since a state was read
  std::optional<OdometryComparison> comparison_;
};

// Length of the base's way in the plane, at 5 Hz.
double walked_way(const std::vector<RobotState>& states) {
  double way = 0.0;
  for (std::size_t t = kTicksOfWay; t < states.size(); t += kTicksOfWay)
    way += (states[t].X_WB.p - states[t - kTicksOfWay].X_WB.p).head<2>().norm();
  return way;
}

}  // namespace

OdometryError measure_leg_odometry(const std::shared_ptr<const RobotModel>& robot, const OdometryTrial& trial) {
  Measured engine(trial, flat_ground(robot));
  const std::unique_ptr<Controller> controller = make_controller(trial.controller, robot);
  StreamReference source(robot, walk_of(trial), trial.seed);
  Episode episode;
  episode.start = robot->standing_state();
  episode.fall = robot->fall;
  episode.ticks = ticks_of(trial.seconds);
  const Rollout rollout = roll_out(episode, engine, *controller, source);
  OdometryError error = engine.error();
  error.walked = walked_way(rollout.recording.robot);
  error.fell = rollout.recording.outcome != Outcome::kOk;
  return error;
}

}  // namespace duet
