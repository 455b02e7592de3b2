// The operator of a demonstration: holds the dead-man switch, stands the twin up once it is damped, lets it down from
// its rope once its motors hold it and its arms have come to rest, and asks it to run, again and again, until it does.
// A limp or damped robot goes back on the rope. One owner, one thread.
#pragma once

#include <array>

#include "duet/hardware/twin_model.h"

namespace duet {

class TwinOperator {
 public:
  // Before each step of the twin; `time` is the twin's [s].
  void tick(double time, TwinModel& twin);

 private:
  void look(double time, const TwinModel& twin);
  void press(double time, TwinModel& twin);

  double damped_since_ = 0.0, held_since_ = 0.0, still_since_ = 0.0, let_down_at_ = kNever;
  double pressed_until_ = 0.0, next_press_ = 0.0;
  std::array<float, kG1Motors> targets_{};
  RemoteKey pressed_ = RemoteKey::kStart;
  bool stood_ = false;
};

}  // namespace duet
