#include "duet/people/bodies/number_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <utility>

#include "duet/archives/npy/npy.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kMostRows = 20'000'000;  // two days at 120 Hz

NumberTable checked(NumberTable table) {
  for (std::size_t i = 0; i < table.values.size(); ++i)
    if (!std::isfinite(table.values[i])) {
      const std::size_t row = table.shape.empty() ? 1 : table.values.size() / std::max<std::size_t>(table.shape[0], 1);
      table.fail(
          fmt::format("expected finite numbers, found {} at row {}, number {}", table.values[i], i / row, i % row));
    }
  return table;
}

std::vector<double> doubles(const NpyArray& array, const std::string& what) {
  if (const auto* integers = std::get_if<std::vector<std::int64_t>>(&array.values))
    return {integers->begin(), integers->end()};
  if (const auto* numbers = std::get_if<std::vector<double>>(&array.values)) return *numbers;
  throw InputError(what + ": expected numbers, found texts");
}

}  // namespace

void NumberTable::fail(const std::string& fault) const { throw InputError(what + ": " + fault); }

std::string NumberTable::found() const { return shape_text(shape); }

NumberTable table_of(const Npz& npz, const std::string& key) {
  return table_of(npz.array(key), fmt::format("'{}': array '{}'", npz.name(), excerpt(key)));
}

NumberTable table_of(const Pickle& pickle, const PickleNode& node, const std::string& what) {
  PickleNumbers numbers = pickle_numbers(pickle, node, what);
  return checked({.what = fmt::format("'{}': byte {}: {}", pickle.name, node.offset, what),
                  .shape = std::move(numbers.shape),
                  .values = std::move(numbers.values)});
}

NumberTable table_of(const TorchFile& file, const PickleNode& node, const std::string& what) {
  return checked({.what = fmt::format("'{}': {}", file.pickle.name, what),
                  .shape = node.shape,
                  .values = tensor_values(file, node, what)});
}

NumberTable table_of(const NpyArray& array, const std::string& what) {
  return checked({.what = what, .shape = array.shape, .values = doubles(array, what)});
}

NumberTable npy_table(std::string_view bytes, const std::string& name) {
  const std::string what = fmt::format("'{}'", name);
  try {
    return table_of(parse_npy(bytes), what);
  } catch (const InputError& error) {
    if (std::string_view(error.what()).starts_with(what)) throw;
    throw InputError(fmt::format("{}: {}", what, error.what()));
  }
}

const NumberTable& checked_rows(const NumberTable& table, std::initializer_list<std::size_t> row_sizes,
                                const std::string& expected, int rows) {
  const std::size_t count = table.shape.empty() ? 0 : table.shape.front();
  const std::size_t row_size = count == 0 ? 0 : table.values.size() / count;
  if (count == 0 || count > kMostRows || std::find(row_sizes.begin(), row_sizes.end(), row_size) == row_sizes.end())
    table.fail(fmt::format("expected shape {}, found {}", expected, table.found()));
  if (rows != 0 && table.rows() != rows) table.fail(fmt::format("expected {} frames, found {}", rows, table.rows()));
  return table;
}

NumberTable columns_of(const NumberTable& table, std::size_t first, std::size_t count) {
  const std::size_t rows = table.shape[0], width = table.values.size() / rows;
  NumberTable part{.what = table.what, .shape = {rows, count}, .values = {}};
  part.values.reserve(rows * count);
  for (std::size_t t = 0; t < rows; ++t) {
    const auto row = table.values.begin() + static_cast<std::ptrdiff_t>(t * width + first);
    part.values.insert(part.values.end(), row, row + static_cast<std::ptrdiff_t>(count));
  }
  return part;
}

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
