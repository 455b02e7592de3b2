// Files of torch.save (the zip of PyTorch 1.6 and later): dicts and lists of tensors, read as passive nodes. Nothing in
// them is executed. Thread-safe. (Modules, TorchScript: nn/torch_archive.h.)
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/pickle/pickle_node.h"

namespace duet {

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

}  // namespace duet
