#include "duet/backends/conformance/deviations.h"

#include <algorithm>
#include <array>

namespace duet::conformance {
namespace {

constexpr std::array kDeviations = {
    Deviation{.engine = "ode",
              .scene = "acceleration",
              .quantity = "error of the acceleration, relative",
              .reason =
                  "Maximal coordinates: the new velocity obeys the joints of the old pose, so terms of products of "
                  "velocities come one step late. The trajectory converges: scenes free-flight and chain.",
              .bound = 0.5},
    Deviation{.engine = "mujoco",
              .scene = "incline",
              .quantity = "acceleration of sliding",
              .reason = "The friction cone is convex: a contact that slides also pushes the bodies apart, the sledge "
                        "hops down the slope. Slip angle and creep hold.",
              .bound = 0.45},
    Deviation{.engine = "ode",
              .scene = "box-complex",
              .quantity = "order of the drift of the angular momentum",
              .reason =
                  "The gyroscopic term is implicit and damps the tumble, and there is only so much to damp: the drift "
                  "levels off above 1 ms. Below it the order rises to one.",
              .bound = 0.85},
    Deviation{.engine = "ode",
              .scene = "ground-bounce",
              .quantity = "energy given back",
              .reason =
                  "Overlap is taken back at erp / dt times its depth, and that speed stays: the shorter the step, the "
                  "more. At 1 and 2 ms it is below 1 %.",
              .bound = 0.05,
              .shows = Effort::kFull},
};

}  // namespace

std::span<const Deviation> deviations() { return kDeviations; }

const Deviation* find_deviation(std::string_view engine, std::string_view scene, std::string_view quantity) {
  const auto found = std::find_if(kDeviations.begin(), kDeviations.end(), [&](const Deviation& entry) {
    return entry.engine == engine && entry.scene == scene && quantity.starts_with(entry.quantity);
  });
  return found == kDeviations.end() ? nullptr : &*found;
}

}  // namespace duet::conformance
