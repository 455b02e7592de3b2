// Files of joblib.dump: a pickle in which the bytes of NumPy arrays follow the objects that describe them, plain or
// compressed as a whole.
#pragma once

#include <string>
#include <string_view>

#include "duet/archives/pickle/pickle_node.h"

namespace duet {

// Plain pickles of NumPy arrays are read too. `bytes` must outlive the result (not where they are compressed). Throws
// InputError naming file, byte, expected and found; compression other than zlib and gzip is refused by name.
Pickle parse_joblib(std::string_view bytes, const std::string& name);

}  // namespace duet
