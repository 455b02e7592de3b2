// The objects that joblib, Python's collections and torch put into a pickle beside NumPy's own
// (archives/pickle/pickle_objects.h), each as a passive node. `offset` is the opcode's, for messages; every function
// throws InputError for content that they would not have written.
#pragma once

#include <string_view>
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

// NumPy's objects inside a pickle: which names are known, what a call of one gives, what its state fills. `offset` is
// the opcode's, for messages; every function throws InputError for what NumPy would not have written.

// Refuses every name but NumPy's six, by name.
PickleCallable find_callable(const Pickle& pickle, std::size_t offset, std::string_view module, std::string_view name);

// The value that stands for callable(*arguments).
PickleNode reduced(const Pickle& pickle, std::size_t offset, PickleCallable callable,
                   const std::vector<int>& arguments);

// Fills a dtype or an array from its state.
void build_object(Pickle& pickle, std::size_t offset, int object, const std::vector<int>& state);

}  // namespace duet
