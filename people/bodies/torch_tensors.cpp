#include "duet/people/bodies/torch_tensors.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <utility>

#include "duet/archives/pickle/pickle_machine.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/half.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr ZipLimits kTorchLimits{.entry_bytes = std::size_t{1} << 30, .total_bytes = std::size_t{1} << 30};
// A tensor may repeat its numbers (stride 0): as many as this, beyond what the storage has.
constexpr std::size_t kMostRepeated = std::size_t{1} << 20;

template <typename T>
double number_at(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return static_cast<double>(value);
}

double half_at(const char* at) {
  std::uint16_t bits;
  std::memcpy(&bits, at, sizeof bits);
  return number_of_half(bits);
}

struct TensorType {
  std::string_view code;
  std::size_t size;
  double (*read)(const char*);
};
constexpr std::array<TensorType, 8> kTypes = {{{"f4", 4, number_at<float>},
                                               {"f8", 8, number_at<double>},
                                               {"f2", 2, half_at},
                                               {"i8", 8, number_at<std::int64_t>},
                                               {"i4", 4, number_at<std::int32_t>},
                                               {"i2", 2, number_at<std::int16_t>},
                                               {"i1", 1, number_at<std::int8_t>},
                                               {"u1", 1, number_at<std::uint8_t>}}};

// How many numbers the tensor has; throws where it reaches beyond `available`.
std::size_t checked_numbers(const Pickle& pickle, const PickleNode& tensor, std::size_t available,
                            const std::string& what) {
  std::size_t count = 1, last = static_cast<std::size_t>(tensor.integer);
  bool fits = true, empty = false;
  for (std::size_t d = 0; d < tensor.shape.size(); ++d) {
    std::size_t reach = 0;
    empty = empty || tensor.shape[d] == 0;
    fits = fits && !__builtin_mul_overflow(count, std::max<std::size_t>(tensor.shape[d], 1), &count) &&
           !__builtin_mul_overflow(std::max<std::size_t>(tensor.shape[d], 1) - 1, tensor.strides[d], &reach) &&
           !__builtin_add_overflow(last, reach, &last);
  }
  if (empty) return 0;
  if (!fits || last >= available || count > std::max(available, kMostRepeated))
    pickle.fail(
        tensor.offset,
        fmt::format("{}: a tensor of shape ({}) and strides ({}) from number {} on does not lie in a storage of "
                    "{} numbers",
                    what, fmt::join(tensor.shape, ", "), fmt::join(tensor.strides, ", "), tensor.integer, available));
  return count;
}

}  // namespace

TorchFile parse_torch(std::string_view bytes, const std::string& name) {
  TorchFile file;
  std::unique_ptr<const std::string> pickled;  // what the nodes look into
  read_zip(bytes, name, kTorchLimits, [&](const std::string& entry, const std::string& content) {
    // "archive/data/0", "archive/data.pkl": the first folder has any name.
    const std::string inside = entry.substr(std::min(entry.find('/') + 1, entry.size()));
    if (inside == "byteorder" && !content.starts_with("little"))
      throw InputError(fmt::format("'{}': expected little-endian numbers", name));
    if (inside == "data.pkl") pickled = std::make_unique<const std::string>(content);
    if (inside.starts_with("data/")) file.storages[inside.substr(5)] = content;
  });
  if (!pickled) throw InputError(fmt::format("'{}': expected an entry 'data.pkl' of torch.save, found none", name));
  file.pickle = parse_pickle(*pickled, name + ": data.pkl", PickleFlavour::kTorch);
  file.pickle.owned = std::move(pickled);
  return file;
}

std::vector<double> tensor_values(const TorchFile& file, const PickleNode& node, const std::string& what) {
  const Pickle& pickle = file.pickle;
  if (node.kind != PickleKind::kTensor)
    pickle.fail(node.offset, fmt::format("{}: expected a torch tensor, found {}", what, to_string(node.kind)));
  const PickleNode& storage = pickle[node.data];
  const auto content = file.storages.find(pickle[storage.data].text);
  if (content == file.storages.end())
    pickle.fail(node.offset, fmt::format("{}: the archive has no entry for its numbers", what));
  const auto type =
      std::find_if(kTypes.begin(), kTypes.end(), [&](const TensorType& known) { return known.code == storage.text; });
  const std::size_t count = checked_numbers(pickle, node, content->second.size() / type->size, what);
  std::vector<double> values(count);
  std::vector<std::size_t> index(node.shape.size(), 0);
  auto place = static_cast<std::size_t>(node.integer);
  for (double& value : values) {
    value = type->read(content->second.data() + place * type->size);
    for (std::size_t d = node.shape.size(); d-- > 0;) {
      place += node.strides[d];
      if (++index[d] < node.shape[d]) break;
      place -= node.strides[d] * node.shape[d];
      index[d] = 0;
    }
  }
  return values;
}

}  // namespace duet
