// Numbers with a shape, out of whichever container held them (NPZ, pickle, torch, NPY), and what is said where they are
// not as expected. Every value is finite.
#pragma once

#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/archives/pickle/pickle_node.h"

namespace duet {

// Files of torch.save (the zip of PyTorch 1.6 and later): dicts and lists of tensors, read as passive nodes. Nothing in
// them is executed. Thread-safe. (Modules, TorchScript: nn/torch/torch_archive.h.)

struct TorchFile {
  Pickle pickle;
  std::map<std::string, std::string, std::less<>> storages;  // bytes by key
};

// Throws InputError naming file, place, expected and found: no archive, no data.pkl, big-endian numbers, a name that no
// tensor needs, more than 1 GiB.
TorchFile parse_torch(std::string_view bytes, const std::string& name);

// The numbers of a tensor in C order of its shape, whatever its strides, of floats, doubles, halves or integers. `what`
// stands in messages. Throws InputError: no tensor, a storage that is absent or too small, more numbers than the file
// could mean.
std::vector<double> tensor_values(const TorchFile& file, const PickleNode& node, const std::string& what);

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
