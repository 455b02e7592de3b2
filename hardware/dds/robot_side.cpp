#include "duet/hardware/dds/robot_side.h"

#include "duet/core/require.h"
#include "duet/hardware/executors/arm_action.h"
#include "duet/hardware/executors/homie_executor.h"
#include "duet/hardware/wire/odometry_source.h"

namespace duet {
namespace {

// The number of writers of low-level commands on a robot that this executor steers: HOMIE's controller is one; for the
// maker's walking the number is not known.
int expected_writers(ExecutorKind kind) {
  constexpr int kAny = 1000;
  if (is_makers(kind)) return kAny;
  return kind == ExecutorKind::kHomieLcm ? 1 : 0;
}

}  // namespace

RobotSide::RobotSide(const RobotConfig& config, const RobotSideOptions& options)
    : wire_(open_robot_wire(config.place())) {
  make_odometry(config, options);
  make_executor(config, options);
  connection_ = std::make_unique<RobotConnection>(*wire_, *executor_, odometry_.get());
}

void RobotSide::make_odometry(const RobotConfig& config, const RobotSideOptions& options) {
  switch (config.odometry) {
    case OdometrySource::kNone:
      break;
    case OdometrySource::kLegs:
      odometry_ = std::make_unique<LegOdometry>(load_shared_robot());
      break;
    case OdometrySource::kExternal:
      odometry_ = std::make_unique<ExternalOdometry>(DatagramSocket::at_path(options.pose_socket));
      break;
    case OdometrySource::kVendor:
    case OdometrySource::kTwin:
      odometry_ = std::make_unique<WireOdometry>(*wire_);
      break;
  }
}

void RobotSide::make_executor(const RobotConfig& config, const RobotSideOptions& options) {
  const ExecutorKind kind = options.commands ? config.executor : ExecutorKind::kTwin;
  if (kind == ExecutorKind::kHomieLcm) {
    executor_ = std::make_unique<HomieExecutor>(config.lcm, config.limits.height, options.period);
  } else if (is_makers(kind)) {
    constexpr Service kCalled[] = {Service::kSport, Service::kArm};
    sport_ = open_sport_wire(config.place(), kCalled);
    const int action = config.arm_action.empty() ? 0 : arm_preset(config.arm_action).id;
    executor_ = std::make_unique<SportExecutor>(*sport_, options.period, action);
  } else {
    require(!options.commands || kind == ExecutorKind::kLowcmd || options.velocity_port > 0,
            "executor 'twin': expected a port that takes its velocities (--velocity-port), found none");
    if (options.commands && options.velocity_port > 0)
      velocity_ =
          std::make_unique<LcmVelocity>(DatagramSocket::to_port(static_cast<std::uint16_t>(options.velocity_port)));
    else
      velocity_ = std::make_unique<NoVelocity>();
    const int expected = options.commands ? 0 : expected_writers(config.executor);
    executor_ = std::make_unique<MotorExecutor>(*wire_, *velocity_, expected);
  }
  if (!options.commands || is_makers(kind)) return;
  constexpr Service kAsked[] = {Service::kMotionSwitcher};
  sport_ = open_sport_wire(config.place(), kAsked);
  mode_.emplace(*sport_);
}

}  // namespace duet
