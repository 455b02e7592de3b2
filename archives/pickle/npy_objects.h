// NPY arrays of Python objects (numpy.save of a dict): a pickle behind NumPy's header, read as passive nodes.
#pragma once

#include <string>
#include <string_view>

#include "duet/archives/pickle/pickle_node.h"

namespace duet {

// The one object of an array of one (what `.item()` gives in Python). `bytes` is an NPY file or an entry of an NPZ
// archive (archives/zip/zip.h) and must outlive the result, whose root is the object. Throws InputError naming `name`:
// an array of numbers, of more or fewer objects than one, and what the pickle machine says (bytes are counted behind
// the header).
Pickle parse_object_npy(std::string_view bytes, const std::string& name);

}  // namespace duet
