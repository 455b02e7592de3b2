// The module of today's MuJoCo in a host of Node.js.
#include <array>
#include <vector>

#include "duet/backends/engine_module.h"
#include "duet/backends/node/node_engine.h"

namespace duet {
namespace {

const NodeEngine& engine() {
  static const NodeEngine engine = {
      .engine = "mujoco3", .package = "@mujoco/mujoco", .package_version = "3.14.0", .engine_version = "3.14.0"};
  return engine;
}

std::span<const EngineOption> mujoco3_options() {
  static const std::vector<EngineOption> options = {
      choice_option("solver", {"newton", "cg"}, "of the constraint forces"),
      integer_option("iterations", 20, 1, 1000, "of the solver, at most"),
      number_option("tolerance", 1e-8, 0.0, 1.0, "of the solver: scaled improvement at which it ends"),
      choice_option("cone", {"elliptic", "pyramidal"}, "friction cone"),
      number_option("impratio", 10.0, 1.0, 1e4, "stiffness of friction over that of the normal"),
      number_option("ground_time_constant", 0.01, 1e-4, 0.1,
                    "of contacts with the ground and the robot itself, at least two steps [s]")};
  return options;
}

std::string version() { return engine().engine_version; }
std::string absence() { return absence_of(engine()); }
std::unique_ptr<Backend> make(const Scene& scene) { return make_node_backend(engine(), scene, mujoco3_options()); }

constexpr std::string_view kPushesApart =
    "The friction cone is convex: slip adds to the normal force, and friction grows with it. The ratio of both holds.";

constexpr std::array kDeviations = {
    EngineDeviation{.scene = "incline",
                    .quantity = "acceleration of sliding",
                    .reason = "The friction cone is convex: a contact that slides also pushes the bodies apart, the "
                              "sledge hops down the slope. Slip angle and creep hold.",
                    .bound = 0.45},
    EngineDeviation{.scene = "skin-rub", .quantity = "normal force", .reason = kPushesApart, .bound = 1.8},
    EngineDeviation{.scene = "skin-rub",
                    .quantity = "force across the slip, friction 0.6, limb slides on the diagonal",
                    .reason = kPushesApart,
                    .bound = 2.5},
    EngineDeviation{.scene = "skin-rub",
                    .quantity = "torque of the shoulder, friction 0.3, limb slides to the left",
                    .reason = kPushesApart,
                    .bound = 5.0},
    EngineDeviation{.scene = "skin-rub",
                    .quantity = "torque of the shoulder, friction 0.6, limb slides on the diagonal",
                    .reason = kPushesApart,
                    .bound = 13.5},
    EngineDeviation{.scene = "self-rub", .quantity = "normal force", .reason = kPushesApart, .bound = 0.06},
    EngineDeviation{.scene = "self-rub", .quantity = "slowing of the thigh", .reason = kPushesApart, .bound = 0.06},
};

const EngineModule kModule = {.name = "mujoco3",
                              .version = version,
                              .make = make,
                              .options = mujoco3_options(),
                              .deviations = kDeviations,
                              .absence = absence};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
