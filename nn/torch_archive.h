// The parts of a TorchScript archive that say what its module is. Nothing in it is executed. Internal to nn/.
#pragma once

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

}  // namespace duet
