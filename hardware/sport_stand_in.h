// A stand-in for the maker's walking service and its arm topic, for tests and for `duet-g1-services`: calls and their
// answers, velocities that end, arms by weight. No gait: the legs keep the stance. Facts: docs/hardware.md,
// "Executors". A pure function of what it is given. One owner, one thread.
#pragma once

#include "duet/hardware/low_level_frame.h"
#include "duet/hardware/sport_rpc.h"

namespace duet {

class SportStandIn {
 public:
  // `stance`: of kG1Motors joints, what it holds itself.
  explicit SportStandIn(JointCommand stance, int fsm = kFsmStart);

  RpcResponse answer(const RpcRequest& request, double now);
  // A frame of the arm topic; one with a wrong checksum is counted and not obeyed.
  void obey_arms(const LowCommandFrame& frame);
  // The velocity that it walks with now: 0 once the last order has ended.
  [[nodiscard]] VelocityCommand velocity(double now) const;
  // Writes the command to the motors.
  void write_command(std::uint8_t mode_machine, LowCommandFrame& frame);

  [[nodiscard]] int fsm() const { return fsm_; }
  [[nodiscard]] double arm_weight() const { return weight_; }
  [[nodiscard]] long refused() const { return refused_; }

 private:
  JointCommand stance_, joints_;
  int fsm_;
  SportOrder order_;
  double ordered_at_ = kNever, weight_ = 0.0;
  Eigen::VectorXd arms_, arms_kp_, arms_kd_;
  long refused_ = 0;
};

}  // namespace duet
