// The robot's topics, as the guard and as a twin see them; hardware/dds/ has them over DDS. One owner, one thread.
#pragma once

#include "duet/hardware/frame_transport.h"
#include "duet/hardware/odometry.h"

namespace duet {

class RobotWire : public FrameTransport {
 public:
  // The newest sample of the maker's odometry topic; false where none has come. Its place and velocity; `at` is left.
  virtual bool take(OdometrySample& sample) = 0;
  using FrameTransport::take;
};

class TwinWire {
 public:
  virtual ~TwinWire() = default;
  virtual bool take(LowCommandFrame& frame) = 0;
  virtual void write(const LowStateFrame& frame) = 0;
  virtual void write(const OdometrySample& sample) = 0;
  // How many write commands now.
  virtual int command_writers() = 0;
};

}  // namespace duet
