// The content of a TorchScript archive's data.pkl: a module, its members, and which numbers its tensors are. Only the
// opcodes that PyTorch's own writer uses are read, and nothing is ever executed. Internal to nn/.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "duet/nn/torch_archive.h"

namespace duet {

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
