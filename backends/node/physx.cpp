// The module of NVIDIA PhysX 5 in a host of Node.js.
#include <array>
#include <vector>

#include "duet/backends/engine_module.h"
#include "duet/backends/node/node_engine.h"

namespace duet {
namespace {

const NodeEngine& engine() {
  static const NodeEngine engine = {
      .engine = "physx", .package = "physx-js-webidl", .package_version = "2.7.3", .engine_version = "5.6.1"};
  return engine;
}

std::span<const EngineOption> physx_options() {
  static const std::vector<EngineOption> options = {
      choice_option("solver", {"pgs", "tgs"},
                    "projected, or temporal Gauss-Seidel, which makes an iteration a substep"),
      integer_option("position_iterations", 16, 1, 255, "of the solver"),
      integer_option("velocity_iterations", 4, 0, 255, "of the solver")};
  return options;
}

std::string version() { return engine().engine_version; }
std::string absence() { return absence_of(engine()); }
std::unique_ptr<Backend> make(const Scene& scene) { return make_node_backend(engine(), scene, physx_options()); }

constexpr std::string_view kSingle = "PhysX computes in single precision.";

constexpr std::array kDeviations = {
    EngineDeviation{.scene = "state", .quantity = "pose after a step at rest", .reason = kSingle, .bound = 1e-6},
    EngineDeviation{.scene = "state", .quantity = "contact point", .reason = kSingle, .bound = 2e-6},
    EngineDeviation{.scene = "acceleration", .quantity = "error of the acceleration", .reason = kSingle, .bound = 0.1},
    EngineDeviation{.scene = "box-simple", .quantity = "velocity against", .reason = kSingle, .bound = 0.02},
    EngineDeviation{.scene = "box-simple", .quantity = "position against", .reason = kSingle, .bound = 0.5},
    EngineDeviation{.scene = "box-complex", .quantity = "velocity against", .reason = kSingle, .bound = 0.02},
    EngineDeviation{.scene = "box-complex", .quantity = "position against", .reason = kSingle, .bound = 0.5},
    EngineDeviation{.scene = "incline",
                    .quantity = "tangent of the slip angle, friction 0.3, along the diagonal",
                    .reason = "Friction has two directions of its own: along the diagonal it holds a tenth more.",
                    .bound = 0.12},
    EngineDeviation{.scene = "self-rub",
                    .quantity = "drag over normal force",
                    .reason = "The package reports no friction; the thigh slows as it has to.",
                    .bound = 1.0},
    EngineDeviation{.scene = "stand",
                    .quantity = "joint speed, rms",
                    .reason = "At 4 ms the joints buzz at twice what is allowed.",
                    .bound = 0.005,
                    .only_at_full_effort = true},
};

const EngineModule kModule = {.name = "physx",
                              .version = version,
                              .make = make,
                              .options = physx_options(),
                              .deviations = kDeviations,
                              .no_solid_partner = "compliant contacts of its package have no damper",
                              .absence = absence};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
