// From the planner's root pose to the velocity that a walking controller is told, on a robot: the law of supplement
// A.4.3 in its reading that stops (controllers/root_conversion.h), fed by measured odometry. No allocation.
#pragma once

#include "duet/controllers/root_conversion.h"
#include "duet/hardware/limits.h"
#include "duet/hardware/odometry.h"

namespace duet {

class RootVelocity {
 public:
  // Throws std::invalid_argument where nobody measures place and speed of the root (OdometrySource::kNone).
  // `steps_from`: the least forward speed that the walking controller answers by a step [m/s]; nothing slower than it
  // is asked for where the limit allows it.
  RootVelocity(OdometrySource source, const HardwareLimits& limits, double steps_from = 0.0);

  void reset() { conversion_.reset(); }
  // `reference`: pose of the root in the frame of odometry. Where the sample is invalid, not finite or older than
  // `most_age` [s], the answer is to stand, and the law begins anew with the next good one.
  VelocityCommand update(const OdometrySample& odometry, const Reference& reference, double now,
                         double most_age = SafetyRules{}.odometry.hold);

 private:
  RootConversion conversion_;
  double height_;  // where it stands [m]
  RobotState state_;
};

}  // namespace duet
