// Numbers with a shape, out of whichever container held them (NPZ, pickle, torch, NPY), and what is said where they are
// not as expected. Every value is finite.
#pragma once

#include <initializer_list>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/archives/pickle/pickle_node.h"
#include "duet/people/bodies/torch_tensors.h"

namespace duet {

struct NumberTable {
  std::string what;  // "'P1.npz': array 'trans'", for messages
  std::vector<std::size_t> shape;
  std::vector<double> values;  // C order

  // Throws InputError: "`what`: `fault`".
  [[noreturn]] void fail(const std::string& fault) const;
  [[nodiscard]] std::string found() const;  // "(12, 3)"
  [[nodiscard]] int rows() const { return static_cast<int>(shape.front()); }
};

// Each throws InputError naming file, key, what was found, and the first value that is not finite.
NumberTable table_of(const Npz& npz, const std::string& key);
NumberTable table_of(const Pickle& pickle, const PickleNode& node, const std::string& what);
NumberTable table_of(const TorchFile& file, const PickleNode& node, const std::string& what);
NumberTable table_of(const NpyArray& array, const std::string& what);
NumberTable npy_table(std::string_view bytes, const std::string& name);

// The table where it is of shape (T, ...) with rows of one of these sizes (whatever their own shape), T of at least 1
// and, where `rows` is not 0, of `rows`. `expected` stands in the message: "(T, 63) or (T, 21, 3)".
const NumberTable& checked_rows(const NumberTable& table, std::initializer_list<std::size_t> row_sizes,
                                const std::string& expected, int rows = 0);

// Numbers [first, first + count) of each row.
NumberTable columns_of(const NumberTable& table, std::size_t first, std::size_t count);

}  // namespace duet
