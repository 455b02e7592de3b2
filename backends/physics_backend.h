// The common part of the adapters of physics engines: the moving partner, pushes, the points where the robot touches,
// and the order of a snapshot. An engine adds how it is placed, advanced and stored.
#pragma once

#include "duet/backends/backend.h"
#include "duet/backends/link_pushes.h"
#include "duet/backends/narrow_phase.h"
#include "duet/backends/partner.h"
#include "duet/robots/kinematics.h"

namespace duet {

class PhysicsBackend : public Backend {
 protected:
  // Throws what Backend does.
  explicit PhysicsBackend(const Scene& scene);

  MovingPartner partner_;
  LinkPushes pushes_;
  NarrowPhase narrow_phase_;

 private:
  virtual void place() = 0;  // the engine's state from state_, nothing left of an earlier run
  virtual Outcome advance(const JointCommand& command) = 0;       // state_, contacts_ and torques_ after one step
  virtual void append_to(std::vector<double>& values) const = 0;  // what a bitwise continuation needs beyond state_
  virtual void read_from(std::span<const double> values) = 0;     // the same number of values, state_ already read

  void do_reset() final;
  void do_set_partner(const HumanJoints& joints, const HumanJoints& velocities) final;
  Outcome do_step(const JointCommand& command) final;
  void do_push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) final;
  void do_snapshot(Snapshot& snapshot) const final;
  void do_restore(std::span<const double> values) final;

  Kinematics kinematics_;  // of state_, where a push is set
};

}  // namespace duet
