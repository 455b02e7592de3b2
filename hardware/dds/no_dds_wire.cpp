// A build without DDS: everything else of the room is there.
#include "duet/core/require.h"
#include "duet/hardware/dds/dds_wire.h"

namespace duet {
namespace {

[[noreturn]] void refuse() {
  throw MissingError("this build has no DDS: install cyclonedds-dev and cyclonedds-tools, then configure anew");
}

}  // namespace

bool has_dds() { return false; }
std::unique_ptr<RobotWire> open_robot_wire(const DdsPlace&) { refuse(); }
std::unique_ptr<TwinWire> open_twin_wire(const DdsPlace&) { refuse(); }
std::unique_ptr<SportWire> open_sport_wire(const DdsPlace&, std::span<const Service>) { refuse(); }
std::unique_ptr<ServicesWire> open_services(const DdsPlace&, std::span<const Service>) { refuse(); }
std::string dds_type_digest(const std::string&) { refuse(); }

}  // namespace duet
