// The keys of a suite: one table, from which suite files are read, checked, written in their resolved form (which is
// hashed), listed and documented (docs/reference/suite-keys.md).
#pragma once

#include <vector>

#include "duet/experiment/suite_file/suite_key.h"

namespace duet {

// All keys, in the order in which they are read and written.
const std::vector<SuiteKey>& suite_keys();

}  // namespace duet
