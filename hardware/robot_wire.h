// The robot's topics, as the guard and as a twin see them; hardware/dds/ has them over DDS. One owner, one thread.
#pragma once

#include "duet/hardware/battery.h"
#include "duet/hardware/frame_transport.h"
#include "duet/hardware/odometry.h"

namespace duet {

class RobotWire : public FrameTransport {
 public:
  // The newest sample of the maker's odometry topic; false where none has come. Its place and velocity; `at` is left.
  virtual bool take(OdometrySample& sample) = 0;
  // The newest state of the battery; false where none has come.
  virtual bool take(BatteryReading&) { return false; }
  // Takes what the executor of the commands has sent by `now`; when it was last heard of and well, kNever where it was
  // not or does not answer.
  virtual double executor_heard([[maybe_unused]] double now) { return kNever; }
  // Until a state can be taken, at most so long [s]; false where none came.
  virtual bool wait(double) { return false; }
  using FrameTransport::take;
};

class TwinWire {
 public:
  virtual ~TwinWire() = default;
  virtual bool take(LowCommandFrame& frame) = 0;
  virtual void write(const LowStateFrame& frame) = 0;
  virtual void write(const OdometrySample& sample) = 0;
  virtual void write(const BatteryReading&) {}
  // How many write commands now.
  virtual int command_writers() = 0;
  // Until a command can be taken, at most so long [s]; false where none came.
  virtual bool wait(double) { return false; }
};

}  // namespace duet
