// A stand-in for the maker's arm actions, for tests and for `duet-g1-services`: numbers in, frames of the arm topic
// out. The motions are ours (those of the control `vendor`), not the maker's. A pure function of what it is given. One
// owner, one thread.
#pragma once

#include <memory>
#include <vector>

#include "duet/hardware/executors/arm_action.h"
#include "duet/hardware/executors/sport_executor.h"
#include "duet/hardware/twin/fakes.h"
#include "duet/policies/policy.h"

namespace duet {

class FakeArms {
 public:
  // `robot` has the G1's motors.
  explicit FakeArms(std::shared_ptr<const RobotModel> robot);
  ~FakeArms();

  // An action begins, or is released; refused where the walking does not walk, somebody else has the arm topic, another
  // action is not over, or the number is not one of ours.
  RpcResponse answer(const RpcRequest& request, double now, int fsm);
  // A frame that came on the arm topic from somebody else.
  void see_others(double now) { others_at_ = now; }
  // The frame of the arm topic of now, with its weight, which the last of an action has at 0; false where none is on.
  bool write_arms(std::uint8_t mode_machine, double now, LowCommandFrame& frame);

  [[nodiscard]] int action() const { return preset_ == nullptr ? 0 : preset_->id; }  // that is on; 0: none

 private:
  std::int32_t begin(int id, double now, int fsm);
  [[nodiscard]] bool is_over(double now) const;

  std::shared_ptr<const RobotModel> robot_;
  std::unique_ptr<Policy> motion_;
  std::vector<Reference> planned_;  // from planned_from_ on, 50 a second
  JointCommand joints_;
  const ArmPreset* preset_ = nullptr;
  double begun_ = 0.0, released_ = kNever, others_at_ = kNever;  // [s]
  int planned_from_ = 0;                                         // tick
};

}  // namespace duet
