// Takes the place of the engine in a build without MuJoCo.
#include "backends/mujoco/bare_loop.h"
#include "backends/mujoco/mujoco.h"
#include "core/require.h"

namespace duet {
namespace {

constexpr const char* kReason = "built without MuJoCo (DUET_WITH_MUJOCO=OFF, or its development files were not found)";

[[noreturn]] void refuse() { throw MissingError(std::string("engine 'mujoco': ") + kReason); }

}  // namespace

EngineInfo mujoco_info() { return {.name = "mujoco", .available = false, .version = "", .reason = kReason}; }

std::unique_ptr<Backend> make_mujoco_backend(const Scene&) { refuse(); }

double mujoco_bare_step_seconds(const Scene&, const RobotState&, const JointCommand&, int) { refuse(); }

}  // namespace duet
