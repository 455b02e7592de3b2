// The objects that joblib, Python's collections and torch put into a pickle beside NumPy's own
// (archives/pickle/pickle_numpy.h), each as a passive node. `offset` is the opcode's, for messages; every function
// throws InputError for content that they would not have written.
#pragma once

#include <vector>

#include "duet/archives/pickle/pickle_node.h"

namespace duet {

// The array that a joblib.numpy_pickle.NumpyArrayWrapper describes, without its bytes. `integer` is its alignment, 0
// where the bytes follow without padding.
PickleNode joblib_array(const Pickle& pickle, std::size_t offset, const PickleNode& wrapper);

// How many bytes an array of that shape and type takes.
std::size_t array_bytes(const Pickle& pickle, std::size_t offset, const PickleNode& array);

// collections.OrderedDict(), collections.defaultdict(dict): a dict.
PickleNode empty_dict(const Pickle& pickle, std::size_t offset, const std::vector<int>& arguments);

// ("storage", class of its numbers, key, device, count) of torch.save: `text` is the type of its numbers ("f4"), `data`
// the node of its key, `integer` the count.
PickleNode torch_storage(const Pickle& pickle, std::size_t offset, int identity);

// torch._utils._rebuild_tensor_v2(storage, first, sizes, strides, ...).
PickleNode torch_tensor(const Pickle& pickle, std::size_t offset, const std::vector<int>& arguments);

}  // namespace duet
