// How the guard reaches the robot's low-level topics; a test has one in memory. The writer of commands is made when the
// robot is armed and not before: what does not exist sends nothing by mistake. One owner, one thread.
#pragma once

#include "duet/controllers/root_conversion.h"
#include "duet/hardware/low_level_frame.h"
#include "duet/hardware/safety_machine.h"

namespace duet {

class FrameTransport {
 public:
  virtual ~FrameTransport() = default;
  // The next state that has arrived; false where there is none.
  virtual bool take(LowStateFrame& frame) = 0;
  // How many others write commands to this robot now.
  virtual int foreign_writers() = 0;
  // Throws std::runtime_error where the writer cannot be made.
  virtual void open_writer() = 0;
  virtual void close_writer() = 0;
  [[nodiscard]] virtual bool has_writer() const = 0;
  // Without a writer: nothing happens. False where it was not sent.
  virtual bool write(const LowCommandFrame& frame) = 0;
};

// The executor of the root's velocity, beside the low-level topic.
class VelocitySink {
 public:
  virtual ~VelocitySink() = default;
  // Once a tick, after the frame of that tick.
  virtual void send(const VelocityCommand& velocity) = 0;
  // Once a tick, before it.
  virtual void enter(SafetyState) {}
};

}  // namespace duet
