#include "duet/hardware/odometry_trial.h"

#include <algorithm>
#include <cmath>

#include "duet/backends/factory.h"
#include "duet/controllers/registry.h"
#include "duet/core/clock.h"
#include "duet/core/random.h"
#include "duet/hardware/leg_odometry.h"
#include "duet/robots/dynamics.h"
#include "duet/rollout/reference_source.h"

namespace duet {
namespace {

constexpr int kStepsOfTick = 10, kTicksOfWay = 10;

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

// What joints and IMU would say.
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
  explicit OdometryComparison(const RobotState& start) : begin_(start.X_WB.p), last_(start.X_WB.p) {}

  void add(const RobotState& state, const OdometrySample& sample) {
    const Eigen::Vector3d off = sample.X_WB.p - state.X_WB.p + Eigen::Vector3d(begin_.x(), begin_.y(), 0.0);
    error_.end = off.head<2>().norm();
    error_.largest = std::max(error_.largest, error_.end);
    error_.height = std::max(error_.height, std::abs(off.z()));
    squares_ += (sample.v_WB - state.v_WB).head<2>().squaredNorm();
    ++count_;
  }
  void walk_to(const Eigen::Vector3d& p_WB) {
    error_.walked += (p_WB - last_).head<2>().norm();
    last_ = p_WB;
  }
  [[nodiscard]] OdometryError error() const {
    OdometryError error = error_;
    error.speed_rms = std::sqrt(squares_ / static_cast<double>(count_));
    return error;
  }

 private:
  Eigen::Vector3d begin_, last_;
  OdometryError error_;
  double squares_ = 0.0;
  long count_ = 0;
};

}  // namespace

OdometryError measure_leg_odometry(const std::shared_ptr<const RobotModel>& robot, const OdometryTrial& trial) {
  const std::unique_ptr<Backend> backend = make_backend(trial.engine, flat_ground(robot));
  const std::unique_ptr<Controller> controller = make_controller(trial.controller, robot);
  StreamReference source(robot, walk_of(trial), trial.seed);
  Random random(trial.seed, stream_key({"odometry trial"}));
  const RobotState start = robot->standing_state();
  backend->reset(start);
  controller->reset(start);
  source.begin(start);
  LegOdometry odometry(robot);
  odometry.update(measured(start, trial, random), {0.0, 0.0, kGravity});
  OdometryComparison comparison(start);
  JointCommand command = robot->default_command(robot->neutral);
  bool fell = false;
  for (int tick = 0; tick < ticks_of(trial.seconds) && !fell; ++tick) {
    const Reference* reference = source.at({.tick = tick, .robot = backend->state(), .partner = nullptr});
    controller->act(backend->state(), *reference, command);
    for (int step = 0; step < kStepsOfTick; ++step) {
      const Eigen::Vector3d v_before = backend->state().v_WB;
      fell = backend->step(command) != Outcome::kOk || fell;
      const RobotState& now = backend->state();
      const Eigen::Vector3d a_W = (now.v_WB - v_before) / backend->scene().dt + kGravity * Eigen::Vector3d::UnitZ();
      odometry.update(measured(now, trial, random), measured_force(now.X_WB.R.conjugate() * a_W, trial, random));
      comparison.add(backend->state(), odometry.sample());
    }
    if (tick % kTicksOfWay == 0) comparison.walk_to(backend->state().X_WB.p);
    fell = fell || has_fallen(backend->state(), robot->fall);
  }
  OdometryError error = comparison.error();
  error.fell = fell;
  return error;
}

}  // namespace duet
