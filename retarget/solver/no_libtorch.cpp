// A build without libtorch: says so.
#include "duet/core/require.h"
#include "duet/retarget/solver/pair_solver.h"

namespace duet {
namespace {

[[noreturn]] void refuse() {
  throw MissingError("libtorch is not part of this build; configure with -DDUET_WITH_LIBTORCH=ON");
}

}  // namespace

bool libtorch_available() { return false; }

double libtorch_frames_per_second(const InteractionClip&, const RobotModel&, int) { refuse(); }

std::vector<double> libtorch_objective(const PairProblem&, int) { refuse(); }

}  // namespace duet
