// The G1's topics over DDS. Quality of service is set by hand (volatile, the last sample; writers reliable, readers
// best effort: a late state is worse than none); the configuration comes from DdsPlace alone: what the environment says
// about DDS is not read.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "duet/hardware/executors/sport_executor.h"
#include "duet/hardware/wire/robot_wire.h"

namespace duet {

// Whether this build has DDS (DUET_WITH_DDS).
bool has_dds();

// Throw std::invalid_argument as check_place and check_twin_place do, MissingError in a build without DDS,
// std::runtime_error with the library's message where it refuses (no such interface).
std::unique_ptr<RobotWire> open_robot_wire(const DdsPlace& place);
std::unique_ptr<TwinWire> open_twin_wire(const DdsPlace& place);

// SHA-256 of what DDS tells others of a type ("unitree_hg::msg::dds_::LowCmd_"): its information, then its mapping.
// Throws std::invalid_argument for an unknown type, MissingError without DDS.
std::string dds_type_digest(const std::string& type);

// The maker's services over DDS: their calls and the arm topic, as a client (hardware/executors/sport_executor.h) and
// as a stand-in that serves them.

// Opens the wire as open_robot_wire does.
// `services`: that are called; the arm topic is there with any.
std::unique_ptr<SportWire> open_sport_wire(const DdsPlace& place, std::span<const Service> services);

// The other side, in a twin's domain.
class ServicesWire {
 public:
  virtual ~ServicesWire() = default;
  // The next call of that service; false where there is none, or the service is not one of those that were opened.
  virtual bool take(Service service, RpcRequest& request) = 0;
  virtual void respond(Service service, const RpcResponse& response) = 0;
  virtual bool take_arms(LowCommandFrame& frame) = 0;
};
std::unique_ptr<ServicesWire> open_services(const DdsPlace& place, std::span<const Service> services);

}  // namespace duet
