// One run directory from several of one suite: what each of several people ran, with the inputs of all.
#pragma once

#include <string>
#include <vector>

#include "duet/results/run_union.h"

namespace duet {

// Writes `folder` at once: it is there whole or not at all. `both` is the union of `runs` and has no conflicts. Throws
// InputError where `folder` is there already.
void write_merged(const std::vector<Run>& runs, const RunUnion& both, const std::vector<std::string>& argv,
                  const std::string& folder);

}  // namespace duet
