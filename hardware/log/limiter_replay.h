// Passes the ticks of a log through a limiter made of what stands in it: the same bits, or which ticks differ. What was
// changed, and at which joint, is counted anew: no log has it.
#pragma once

#include <string>
#include <vector>

#include "duet/hardware/log/run_log.h"
#include "duet/hardware/safety/limiter.h"

namespace duet {

// One owner, one thread.
class LimiterReplay {
 public:
  // Throws InputError naming `name` for a setup that no limiter can be made of.
  LimiterReplay(const LimiterSetup& setup, const std::string& name);

  // Whether the limiter makes of the tick what the log has, to the bit.
  bool agrees(const TickRecord& record);
  // The last tick's.
  [[nodiscard]] const ClampCounts& clamps() const { return clamps_; }
  [[nodiscard]] const Limiter& limiter() const { return limiter_; }

 private:
  Limiter limiter_;
  LimiterState state_;
  LimiterInput input_;
  HumanJoints person_;
  MotionCommand command_;
  LimitedCommand out_;
  ClampCounts clamps_{};
  Eigen::VectorXd restart_;
};

struct LogReplay {
  long ticks = 0, different = 0;
  long dropped = 0;                 // ticks that are not in the log: the next one may differ for it
  bool whole = false;               // the log has its end
  std::vector<std::string> events;  // states and causes, in order
};

// Compares each output to the bit. Throws as read_run_log() (hardware/log/log_reader.h).
LogReplay replay_log(const std::string& path);

}  // namespace duet
