// The part of Python's pickle format (protocols 2 to 5) that dicts of NumPy arrays, numbers, strings and lists use. A
// file builds passive nodes and nothing else: no class is ever looked up, and no call made; the names that its flavour
// knows stand for arrays. Work and memory are linear in the size of the file; nothing recurses. Thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/pickle/pickle_node.h"

namespace duet {

// `bytes` must outlive the result. Throws InputError naming file, byte offset, expected and found.
Pickle parse_pickle(std::string_view bytes, const std::string& name, PickleFlavour flavour = PickleFlavour::kNumPy);

// Values of an array or NumPy scalar of f2, f4, f8, i1..i8 or u1..u8, in C order. `what` stands in messages. Throws
// InputError for another node or type, or a size that does not match the shape.
std::vector<double> array_values(const Pickle& pickle, const PickleNode& node, const std::string& what);

struct PickleNumbers {
  std::vector<std::size_t> shape;  // empty for a single number
  std::vector<double> values;      // in C order
};

// Numbers in any of the ways in which programs put them: a number, an array as above, lists and tuples of these, nested
// up to 8 deep and all of one shape. Throws InputError as above, for lists that disagree and for more than 2^22 numbers
// in lists.
PickleNumbers pickle_numbers(const Pickle& pickle, const PickleNode& node, const std::string& what);

// One number, alone or in brackets of any kind, or as text ("30"). Throws InputError for anything else.
double pickle_number(const Pickle& pickle, const PickleNode& node, const std::string& what);

}  // namespace duet
