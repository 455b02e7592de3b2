// NumPy's objects inside a pickle: which names are known, what a call of one gives, what its state fills. `offset` is
// the opcode's, for messages; every function throws InputError for what NumPy would not have written.
#pragma once

#include <string_view>
#include <vector>

#include "duet/archives/pickle/pickle_node.h"

namespace duet {

// Refuses every name but NumPy's six, by name.
PickleCallable find_callable(const Pickle& pickle, std::size_t offset, std::string_view module, std::string_view name);

// The value that stands for callable(*arguments).
PickleNode reduced(const Pickle& pickle, std::size_t offset, PickleCallable callable,
                   const std::vector<int>& arguments);

// Fills a dtype or an array from its state.
void build_object(Pickle& pickle, std::size_t offset, int object, const std::vector<int>& state);

}  // namespace duet
