// The maker's services over DDS: their calls and the arm topic, as a client (hardware/sport_executor.h) and as a
// stand-in that serves them.
#pragma once

#include <memory>

#include "duet/hardware/dds_place.h"
#include "duet/hardware/sport_executor.h"

namespace duet {

// Opens the wire as open_robot_wire does.
std::unique_ptr<SportWire> open_sport_wire(const DdsPlace& place);

// The other side, in a twin's domain.
class SportServiceWire {
 public:
  virtual ~SportServiceWire() = default;
  virtual bool take(RpcRequest& request) = 0;
  virtual void respond(const RpcResponse& response) = 0;
  virtual bool take_arms(LowCommandFrame& frame) = 0;
};
std::unique_ptr<SportServiceWire> open_sport_service(const DdsPlace& place);

}  // namespace duet
