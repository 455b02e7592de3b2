#include "duet/core/require.h"
#include "duet/training/dstar/trainer.h"

namespace duet {
namespace {

[[noreturn]] void refuse() {
  throw MissingError(
      "this program was built without libtorch, which trains D-STAR: `./run train dstar ...` installs it and builds a "
      "program that has it (-DDUET_WITH_LIBTORCH=ON)");
}

}  // namespace

DstarEnd train_dstar(const DstarData&, const DstarRun&, const std::function<void(const DstarProgress&)>&,
                     const std::function<bool()>&) {
  refuse();
}

double runner_difference(const DstarData&, const DstarRun&, const std::string&, int) { refuse(); }

bool can_train_dstar() { return false; }

void need_dstar_trainer() { refuse(); }

std::string training_blas() { return ""; }

}  // namespace duet
