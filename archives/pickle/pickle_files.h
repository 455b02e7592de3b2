// Files that hold a pickle: joblib's, and NumPy's arrays of objects.
#pragma once

#include <string>
#include <string_view>

#include "duet/archives/pickle/pickle_node.h"

namespace duet {

// Files of joblib.dump: a pickle in which the bytes of NumPy arrays follow the objects that describe them, plain or
// compressed as a whole.

// Plain pickles of NumPy arrays are read too. `bytes` must outlive the result (not where they are compressed). Throws
// InputError naming file, byte, expected and found; compression other than zlib and gzip is refused by name.
Pickle parse_joblib(std::string_view bytes, const std::string& name);

// NPY arrays of Python objects (numpy.save of a dict): a pickle behind NumPy's header, read as passive nodes.

// The one object of an array of one (what `.item()` gives in Python). `bytes` is an NPY file or an entry of an NPZ
// archive (archives/zip/zip.h) and must outlive the result, whose root is the object. Throws InputError naming `name`:
// an array of numbers, of more or fewer objects than one, and what the pickle machine says (bytes are counted behind
// the header).
Pickle parse_object_npy(std::string_view bytes, const std::string& name);

}  // namespace duet
