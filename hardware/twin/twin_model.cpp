#include "duet/hardware/twin/twin_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "duet/backends/engine_module.h"
#include "duet/core/require.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

constexpr double kInertia = 0.2;   // of every joint: what its motor and link turn [kg m^2]
constexpr double kFriction = 0.5;  // [N m s/rad]

void check(const TwinOptions& options) {
  for (const double value :
       {options.lag, options.delay, options.place_noise, options.speed_noise, options.joint_noise,
        options.joint_speed_noise, options.gyro_noise, options.acceleration_noise, options.tilt_noise})
    require(std::isfinite(value) && value >= 0.0, "twin: expected numbers of at least 0, found {}", value);
  require(std::isfinite(options.drift), "twin: expected a finite drift, found {}", options.drift);
}

std::shared_ptr<const RobotModel> checked_robot(std::shared_ptr<const RobotModel> robot) {
  require(robot != nullptr && robot->dof() == kG1Motors, "twin: expected a robot of {} joints, found another",
          kG1Motors);
  return robot;
}

bool is_sane(const LowCommandFrame& frame) {
  for (const MotorCommandFrame& motor : frame.motor)
    if (!std::isfinite(motor.q) || !std::isfinite(motor.dq) || !std::isfinite(motor.tau) || !std::isfinite(motor.kp) ||
        !std::isfinite(motor.kd) || motor.kp < 0.0f || motor.kd < 0.0f)
      return false;
  return true;
}

}  // namespace

TwinOptions noisy_twin(double share, const std::string& engine, std::uint64_t seed) {
  TwinOptions twin;
  twin.engine = engine;
  twin.seed = seed;
  twin.place_noise = share * 0.002;
  twin.speed_noise = share * 0.02;
  twin.joint_noise = share * 0.002;
  twin.joint_speed_noise = share * 0.1;
  twin.gyro_noise = share * 0.05;
  twin.acceleration_noise = share * 0.1;
  twin.tilt_noise = share * 0.01;
  return twin;
}

TwinModel::TwinModel(std::shared_ptr<const RobotModel> robot, const TwinOptions& options)
    : robot_(checked_robot(std::move(robot))),
      options_(options),
      random_(options.seed, stream_key({"twin"})),
      trunk_random_(options.seed, stream_key({"twin", "trunk"})),
      kinematics_(*robot_),
      turning_(3, 6 + kG1Motors),
      dynamics_(*robot_),
      weight_(Eigen::VectorXd::Zero(6 + kG1Motors)),
      standing_(Eigen::VectorXd::Zero(kG1Motors)) {
  check(options_);
  const RobotState standing = robot_->standing_state();
  q_ = standing.q;
  X_WB_ = standing.X_WB;
  for (Eigen::VectorXd* values : {&v_, &a_, &tau_}) values->setZero(kG1Motors);
  asked_.height = X_WB_.p.z();
  if (!options_.engine.empty()) physics_ = std::make_unique<TwinPhysics>(options_.engine, robot_, kTwinPeriod);
  if (physics_ == nullptr) stand_on_feet();
}

// Each foot carries half of it, below its ankle.
void TwinModel::stand_on_feet() {
  const RobotState standing = robot_->standing_state();
  dynamics_.bias_forces(standing, weight_);
  kinematics_.update(standing.X_WB, standing.q);
  const std::vector<std::vector<int>> soles = soles_of_feet(*robot_);
  for (std::size_t side = 0; side < soles.size(); ++side) {
    const int foot = robot_->shapes[soles[side][0]].link;
    kinematics_.point_jacobian(foot, kinematics_.p_WL(foot), turning_);
    for (const int joint : robot_->roles.legs[side])
      standing_[joint] = weight_[6 + joint] - 0.5 * robot_->total_mass() * kGravity * turning_(2, 6 + joint);
  }
}

void TwinModel::obey(const LowCommandFrame& frame) {
  const bool whole = frame.crc == checksum_of(frame);
  if (!whole || frame.mode_machine != options_.mode_machine || frame.mode_pr != kPitchRollMode || !is_sane(frame)) {
    ++refused_;
    return;
  }
  ++obeyed_;
  command_ = frame;
}

void TwinModel::meet(const HumanBody& person) {
  require(physics_ != nullptr && time_ == 0.0,
          "twin: expected an engine before its first step for a person who can be "
          "touched, found {}",
          physics_ == nullptr ? "none" : "one that has stepped");
  physics_ = std::make_unique<TwinPhysics>(options_.engine, robot_, kTwinPeriod, person);
}

void TwinModel::step_joints(double dt) {
  RobotState pose = robot_->standing_state();
  pose.q = q_;
  dynamics_.bias_forces(pose, weight_);
  Eigen::VectorXd carried = Eigen::VectorXd::Zero(kG1Motors);
  for (const std::vector<int>& arm : robot_->roles.arms)
    for (const int joint : arm)
      if (command_.motor[joint].kp > 0.0f) carried[joint] = weight_[6 + joint];
  for (int j = 0; j < kG1Motors; ++j) {
    const MotorCommandFrame& motor = command_.motor[j];
    const double effort = robot_->joints[j].effort;
    double tau = 0.0;
    if (motor.mode == 1) tau = motor.kp * (motor.q - q_[j]) + motor.kd * (motor.dq - v_[j]) + motor.tau;
    tau_[j] = std::clamp(tau, -effort, effort);
    v_[j] += dt * (tau_[j] - carried[j] - kFriction * v_[j]) / kInertia;
    q_[j] = std::clamp(q_[j] + dt * v_[j], robot_->joints[j].lower, robot_->joints[j].upper);
  }
}

void TwinModel::step_root(double dt) {
  late_.push_back({time_, asked_});
  while (late_.size() > 1 && late_[1].at <= time_ - options_.delay) late_.pop_front();
  const VelocityCommand velocity =
      late_.front().at <= time_ - options_.delay ? late_.front().velocity : VelocityCommand{};
  const double share = std::min(dt / std::max(options_.lag, dt), 1.0);
  speed_ += share * (Eigen::Vector2d(velocity.forward, velocity.lateral) - speed_);
  yaw_rate_ += share * (velocity.yaw_rate - yaw_rate_);
  const double yaw = yaw_of(X_WB_.R) + dt * yaw_rate_;
  X_WB_.p.head<2>() += dt * (Eigen::Rotation2Dd(yaw) * speed_);
  X_WB_.R = yaw_rotation(yaw);
  v_WB_.head<2>() = Eigen::Rotation2Dd(yaw) * speed_;
  w_WB_B_.z() = yaw_rate_;
}

void TwinModel::step_body(double dt) {
  require(std::abs(dt - physics_->dt()) < 1e-9, "twin: expected steps of {} s in an engine, found {}", physics_->dt(),
          dt);
  physics_->step(command_);
  const RobotState& state = physics_->state();
  q_ = state.q;
  v_ = state.v;
  tau_ = physics_->torques();
  X_WB_ = state.X_WB;
  v_WB_ = state.v_WB;
  w_WB_B_ = state.w_WB_B;
  specific_force_B_ = physics_->specific_force();
  condition.motor_error = condition.motor_error || physics_->diverged();
}

void TwinModel::step(double dt) {
  time_ += dt;
  drifted_ += dt * options_.drift;
  a_ = -v_;
  if (physics_ != nullptr) {
    step_body(dt);
  } else {
    step_joints(dt);
    step_root(dt);
  }
  a_ = (a_ + v_) / dt;
}

void TwinModel::write_imu(const Eigen::Quaterniond& R_WS, double roll, const Eigen::Vector3d& w_WS_S,
                          const Eigen::Vector3d& force_S, Random& random, ImuFrame& imu) const {
  const Eigen::Vector3d lean(roll + options_.tilt_noise * random.normal(), options_.tilt_noise * random.normal(), 0.0);
  const double angle = lean.norm();
  Eigen::Quaterniond R = R_WS;
  if (angle > 0.0) R = R * Eigen::Quaterniond(Eigen::AngleAxisd(angle, lean / angle));
  const double quat_wxyz[4] = {R.w(), R.x(), R.y(), R.z()};
  for (int k = 0; k < 4; ++k) imu.quaternion[k] = static_cast<float>(quat_wxyz[k]);
  const Eigen::Vector3d down_B = R.conjugate() * -Eigen::Vector3d::UnitZ();
  imu.rpy[0] = static_cast<float>(std::atan2(-down_B.y(), -down_B.z()));
  imu.rpy[1] = static_cast<float>(std::asin(std::clamp(down_B.x(), -1.0, 1.0)));
  imu.rpy[2] = static_cast<float>(yaw_of(R));
  for (int axis = 0; axis < 3; ++axis) {
    imu.gyroscope[axis] = static_cast<float>(w_WS_S[axis] + options_.gyro_noise * random.normal());
    imu.accelerometer[axis] = static_cast<float>(force_S[axis] + options_.acceleration_noise * random.normal());
  }
}

void TwinModel::write_trunk_imu(ImuFrame& imu) {
  imu = {};
  const int trunk = robot_->frames[robot_->roles.push_frame].link;
  const Eigen::Quaterniond R_WB = X_WB_.R * Eigen::AngleAxisd(condition.roll, Eigen::Vector3d::UnitX());
  kinematics_.update({R_WB, X_WB_.p}, q_);
  kinematics_.angular_jacobian(trunk, turning_);
  const Eigen::Matrix3d R_TW = kinematics_.R_WL(trunk).transpose();
  const Eigen::Vector3d w_W = turning_.middleCols<3>(3) * w_WB_B_ + turning_.rightCols(kG1Motors) * v_;
  write_imu(Eigen::Quaterniond(kinematics_.R_WL(trunk)), 0.0, R_TW * w_W, R_TW * (R_WB * specific_force_B_),
            trunk_random_, imu);
}

void TwinModel::write_state(LowStateFrame& frame) {
  std::memset(&frame, 0, sizeof(frame));
  frame.mode_pr = static_cast<std::uint8_t>(condition.mode_pr);
  frame.mode_machine = static_cast<std::uint8_t>(options_.mode_machine + condition.mode_machine_offset);
  frame.tick = ++tick_;
  write_imu(X_WB_.R, condition.roll, w_WB_B_, specific_force_B_, random_, frame.imu);
  frame.imu.gyroscope[2] += static_cast<float>(condition.gyro);
  for (int j = 0; j < kG1Motors; ++j) {
    MotorStateFrame& motor = frame.motor[j];
    motor.mode = command_.motor[j].mode;
    motor.q = static_cast<float>(q_[j] + options_.joint_noise * random_.normal());
    motor.dq = static_cast<float>(v_[j] + condition.joint_speed + options_.joint_speed_noise * random_.normal());
    motor.ddq = static_cast<float>(a_[j]);
    const bool stands = command_.motor[j].kp > 0.0f && !condition.hangs;
    motor.tau_est = static_cast<float>(tau_[j] + (stands ? standing_[j] : 0.0));
    motor.vol = static_cast<float>(condition.voltage);
    motor.temperature[0] = static_cast<std::int16_t>(condition.casing);
    motor.temperature[1] = static_cast<std::int16_t>(condition.winding);
    motor.motorstate = condition.motor_error ? 1 : 0;
  }
  write_remote(remote, frame.wireless_remote);
  seal(frame);
}

OdometrySample TwinModel::odometry(double now) {
  OdometrySample sample{.X_WB = X_WB_, .at = now, .valid = true};
  const Eigen::Vector2d noise(random_.normal(), random_.normal());
  sample.X_WB.p.head<2>() += options_.place_noise * noise + Eigen::Vector2d(drifted_, 0.0);
  sample.v_WB = v_WB_;
  sample.v_WB.x() += options_.speed_noise * random_.normal();
  return sample;
}

namespace {

// The rope: it carries the G1's 35 kg with 3 cm of give, and a robot that swings comes to rest in about a second.
constexpr double kRopeStiffness = 10000.0;  // upward [N/m]
constexpr double kRopeDamping = 600.0;      // [N s/m]
constexpr double kSwayStiffness = 1000.0;   // level: of a frame that keeps it over its place [N/m]
constexpr double kSwayDamping = 200.0;      // [N s/m]
constexpr double kHookHeight = 0.25;        // over the origin of the trunk, where its eye bolts are [m]

Scene scene_of(const std::shared_ptr<const RobotModel>& robot, double dt, const HumanBody& person) {
  Scene scene;
  scene.robot = robot;
  scene.human = person;
  scene.partner = person.capsules.empty() ? PartnerMode::kNone : PartnerMode::kSolid;
  scene.dt = dt;
  return scene;
}

}  // namespace

TwinPhysics::TwinPhysics(const std::string& engine, std::shared_ptr<const RobotModel> robot, double dt,
                         const HumanBody& person)
    : robot_(std::move(robot)),
      backend_(make_backend(engine, scene_of(robot_, dt, person))),
      kinematics_(*robot_),
      command_(robot_->default_command(robot_->neutral)),
      jacobian_(3, 6 + robot_->dof()),
      hook_(robot_->frames[robot_->roles.push_frame].link),
      v_before_(Eigen::Vector3d::Zero()) {
  backend_->reset(robot_->standing_state());
  hanging_ = 0.0;
  hang(1.0);
}

void TwinPhysics::hang(double share) {
  if (hanging_ == 0.0 && share > 0.0) {
    kinematics_.update(state().X_WB, state().q);
    anchor_W_ = kinematics_.p_WL(hook_) + kinematics_.R_WL(hook_) * Eigen::Vector3d(0.0, 0.0, kHookHeight);
  }
  hanging_ = std::clamp(share, 0.0, 1.0);
}

// A rope pulls and does not push: upward where the hook is below its place, level towards it.
void TwinPhysics::pull() {
  kinematics_.update(state().X_WB, state().q);
  const Eigen::Vector3d hook_W =
      kinematics_.p_WL(hook_) + kinematics_.R_WL(hook_) * Eigen::Vector3d(0.0, 0.0, kHookHeight);
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  if (hanging_ > 0.0) {
    kinematics_.point_jacobian(hook_, hook_W, jacobian_);
    const RobotState& now = state();
    const Eigen::Vector3d v_W = jacobian_.leftCols<3>() * now.v_WB + jacobian_.middleCols<3>(3) * now.w_WB_B +
                                jacobian_.rightCols(robot_->dof()) * now.v;
    const Eigen::Vector3d off = anchor_W_ - hook_W;
    force = kSwayStiffness * off - kSwayDamping * v_W;
    force.z() = off.z() > 0.0 ? std::max(kRopeStiffness * off.z() - kRopeDamping * v_W.z(), 0.0) : 0.0;
  }
  backend_->push(hook_, hanging_ * force, hook_W);
}

void TwinPhysics::step(const LowCommandFrame& command) {
  if (diverged_) return;
  for (int j = 0; j < kG1Motors; ++j) {
    const MotorCommandFrame& motor = command.motor[j];
    const double enabled = motor.mode == 1 ? 1.0 : 0.0;
    command_.q_target[j] = motor.q;
    command_.kp[j] = enabled * motor.kp;
    command_.kd[j] = enabled * motor.kd;
    command_.tau_ff[j] = enabled * (motor.tau + motor.kd * motor.dq);
  }
  v_before_ = state().v_WB;
  pull();
  diverged_ = backend_->step(command_) != Outcome::kOk;
}

Eigen::Vector3d TwinPhysics::specific_force() const {
  const Eigen::Vector3d a_W = (state().v_WB - v_before_) / dt();
  return state().X_WB.R.conjugate() * (a_W + Eigen::Vector3d(0.0, 0.0, kGravity));
}

}  // namespace duet
