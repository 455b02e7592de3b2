// The parts of a TorchScript archive that say what its module is. Nothing in it is executed. Internal to nn/.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

struct TorchArchive {
  std::string file;                              // for messages
  std::map<int, std::vector<float>> tensors{};   // bytes of data/0, data/1, ..., taken for float
  std::string pickle{};                          // data.pkl: the module's members
  std::map<std::string, std::string> sources{};  // its classes' code by path: "__torch__/torch/nn/modules/linear.py"

  // Throws InputError("'policy.pt': TorchScript: PROBLEM").
  [[noreturn]] void refuse(const std::string& problem) const;
  // The numbers of data/`number`, which are to be finite; throws likewise.
  [[nodiscard]] const std::vector<float>& finite(int number) const;
};

// Throws InputError naming file, place, expected and found: no archive, no data.pkl, numbers that are not in
// little-endian order.
TorchArchive read_torch_archive(std::string_view bytes, const std::string& file);

// Whether the archive holds a module's code ("policy/code/..."): one of torch.save has tensors alone. Throws InputError
// where it is no whole archive.
bool holds_torch_code(std::string_view bytes, const std::string& file);

// The content of a TorchScript archive's data.pkl: a module, its members, and which numbers its tensors are. Only the
// opcodes that PyTorch's own writer uses are read, and nothing is ever executed. Internal to nn/.

enum class TorchKind { kNone, kNumber, kReal, kText, kTuple, kDict, kClass, kStorage, kTensor, kObject };

// One value; others are named by their places in TorchPickle::nodes.
struct TorchNode {
  TorchKind kind = TorchKind::kNone;
  std::int64_t number = 0;               // kNumber (flags too); first number of a kTensor in its storage
  double real = 0.0;                     // kReal
  std::string text{};                    // kText; name of a kClass and of a kObject's; kind of a kStorage's numbers
  std::vector<int> items{};              // kTuple (lists too)
  std::map<std::string, int> members{};  // kDict by text keys, kObject
  int storage = -1;                      // number of a kStorage, a kTensor: data/<storage>
  std::vector<std::int64_t> sizes{}, strides{};  // kTensor
};

struct TorchPickle {
  std::vector<TorchNode> nodes;
  int root = -1;
};

// Throws as TorchArchive::refuse: truncated, an opcode or a call that no module of tensors needs (by name).
TorchPickle read_torch_pickle(const TorchArchive& archive);

}  // namespace duet
