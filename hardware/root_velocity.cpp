#include "duet/hardware/root_velocity.h"

#include "duet/core/require.h"

namespace duet {
namespace {

VelocityInterface interface_of(const HardwareLimits& limits, double steps_from) {
  return {.forward = {-limits.backward, limits.forward, steps_from},
          .lateral = {-limits.lateral, limits.lateral, 0.0},
          .yaw = {-limits.yaw_rate, limits.yaw_rate, 0.0},
          .height = {limits.height - limits.height_range, limits.height + limits.height_range, 0.0},
          .height_offset = 0.0};
}

bool is_finite(const OdometrySample& sample) {
  return sample.X_WB.p.allFinite() && sample.X_WB.R.coeffs().allFinite() && sample.v_WB.allFinite();
}

}  // namespace

RootVelocity::RootVelocity(OdometrySource source, const HardwareLimits& limits, double steps_from)
    : conversion_(RootConversionLaw::kAdopted, interface_of(limits, steps_from)), height_(limits.height) {
  require(source != OdometrySource::kNone,
          "root velocity: expected a source of odometry (legs, external, vendor, twin), found none: supplement A.4.3 "
          "needs the measured place and speed of the root");
}

VelocityCommand RootVelocity::update(const OdometrySample& odometry, const Reference& reference, double now,
                                     double most_age) {
  const double age = now - odometry.at;
  if (!odometry.valid || !is_finite(odometry) || !(age >= 0.0 && age <= most_age)) {
    conversion_.reset();
    return {0.0, 0.0, 0.0, height_};
  }
  state_.X_WB = odometry.X_WB;
  state_.v_WB = odometry.v_WB;
  return conversion_.update(state_, reference, Eigen::Vector3d::Zero(), 0.0);
}

}  // namespace duet
