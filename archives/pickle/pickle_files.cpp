#include "duet/archives/pickle/pickle_files.h"

#include <fmt/format.h>

#include <array>
#include <bit>
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

constexpr std::size_t kMostInflated = std::size_t{1} << 30;

struct Magic {
  std::string_view bytes;
  std::string_view name;
};
constexpr std::array<Magic, 6> kForeign = {{{"BZh", "bz2"},
                                            {"\xfd"
                                             "7zXZ",
                                             "xz"},
                                            {"\x5d", "lzma"},
                                            {"\x04\x22\x4d\x18", "lz4"},
                                            {"\x28\xb5\x2f\xfd", "zstd"},
                                            {"ZF", "the zlib wrapper of joblib before 0.10"}}};

}  // namespace

Pickle parse_joblib(std::string_view bytes, const std::string& name) {
  for (const Magic& magic : kForeign)
    if (bytes.starts_with(magic.bytes))
      throw InputError(
          fmt::format("'{}': compressed with {}: expected no compression, zlib or gzip; write it again "
                      "with joblib.dump(data, path)",
                      name, magic.name));
  if (!bytes.starts_with('\x78') && !bytes.starts_with("\x1f\x8b"))
    return parse_pickle(bytes, name, PickleFlavour::kJoblib);
  auto owned = std::make_unique<const std::string>(inflated(bytes, name, kMostInflated));
  Pickle pickle = parse_pickle(*owned, name, PickleFlavour::kJoblib);
  pickle.owned = std::move(owned);
  return pickle;
}

Pickle parse_object_npy(std::string_view bytes, const std::string& name) {
  NpyHeader header;
  try {
    header = parse_npy_header(bytes, true);
  } catch (const InputError& error) {
    throw InputError(fmt::format("'{}': {}", name, error.what()));
  }
  if (header.type.kind != 'O')
    throw InputError(fmt::format("'{}': expected an array of one Python object, found one of {} {}", name,
                                 header.type.kind == 'U' || header.type.kind == 'S' ? "texts" : "numbers",
                                 shape_text(header.shape)));
  Pickle pickle = parse_pickle(bytes.substr(header.data_begin), name, PickleFlavour::kObjects);
  const PickleNode& root = pickle[pickle.root];
  if (root.kind != PickleKind::kArray || !root.built || pickle[root.data].kind != PickleKind::kList)
    pickle.fail(root.offset, fmt::format("expected an array of objects, found {}", to_string(root.kind)));
  const PickleNode& list = pickle[root.data];
  if (list.items.size() != 1)
    pickle.fail(list.offset, fmt::format("expected an array of one object, found {}", list.items.size()));
  pickle.root = list.items.front();
  return pickle;
}

// NumPy arrays out of the nodes of a pickle.

namespace {

template <typename T>
double read_number(const char* bytes, bool big_endian) {
  char ordered[sizeof(T)];
  for (std::size_t i = 0; i < sizeof(T); ++i) ordered[i] = bytes[big_endian ? sizeof(T) - 1 - i : i];
  T value;
  std::memcpy(&value, ordered, sizeof(T));
  return static_cast<double>(value);
}
double read_half(const char* bytes, bool big_endian) {
  const auto low = static_cast<unsigned char>(bytes[big_endian ? 1 : 0]);
  const auto high = static_cast<unsigned char>(bytes[big_endian ? 0 : 1]);
  return number_of_half(static_cast<std::uint16_t>(high << 8 | low));
}

static_assert(std::endian::native == std::endian::little);

struct ItemType {
  std::size_t size;
  double (*read)(const char*, bool);
};

ItemType item_type(const Pickle& pickle, const PickleNode& node, const PickleNode& dtype, const std::string& what) {
  if (dtype.byte_order == '\0') pickle.fail(node.offset, what + ": the dtype has no state");
  if (dtype.text == "f2") return {2, read_half};
  if (dtype.text == "f4") return {4, read_number<float>};
  if (dtype.text == "f8") return {8, read_number<double>};
  if (dtype.text == "i1") return {1, read_number<std::int8_t>};
  if (dtype.text == "i2") return {2, read_number<std::int16_t>};
  if (dtype.text == "i4") return {4, read_number<std::int32_t>};
  if (dtype.text == "i8") return {8, read_number<std::int64_t>};
  if (dtype.text == "u1") return {1, read_number<std::uint8_t>};
  if (dtype.text == "u2") return {2, read_number<std::uint16_t>};
  if (dtype.text == "u4") return {4, read_number<std::uint32_t>};
  if (dtype.text == "u8") return {8, read_number<std::uint64_t>};
  std::string found;
  for (const unsigned char c : dtype.text.substr(0, 20)) found += c >= 0x20 && c < 0x7f ? static_cast<char>(c) : '?';
  pickle.fail(node.offset,
              fmt::format("{}: expected numbers of type f2, f4, f8, i1..i8 or u1..u8, found '{}'", what, found));
}

// The bytes of a node; protocol 2 keeps them as UTF-8 text of code points below 256.
std::string bytes_of(const Pickle& pickle, const PickleNode& node, const std::string& what) {
  if (!node.latin1_text) return std::string(node.text);
  std::string bytes;
  bytes.reserve(node.text.size());
  for (std::size_t i = 0; i < node.text.size(); ++i) {
    const auto c = static_cast<unsigned char>(node.text[i]);
    if (c < 0x80) {
      bytes += static_cast<char>(c);
    } else if ((c == 0xc2 || c == 0xc3) && i + 1 < node.text.size() &&
               (static_cast<unsigned char>(node.text[i + 1]) & 0xc0) == 0x80) {
      bytes += static_cast<char>((c & 0x03) << 6 | (static_cast<unsigned char>(node.text[++i]) & 0x3f));
    } else {
      pickle.fail(node.offset, fmt::format("{}: the encoded bytes are not Latin-1 text at their byte {}", what, i));
    }
  }
  return bytes;
}

std::size_t item_count(const Pickle& pickle, const PickleNode& array, std::size_t bytes, std::size_t item_size,
                       const std::string& what) {
  std::size_t count = 1;
  for (const std::size_t size : array.shape)
    if (__builtin_mul_overflow(count, size, &count)) count = std::size_t{1} << 60;
  if (bytes % item_size != 0 || count != bytes / item_size)
    pickle.fail(array.offset, fmt::format("{}: the shape ({}) takes {} numbers of {} bytes, found {} bytes", what,
                                          fmt::join(array.shape, ", "), count, item_size, bytes));
  return count;
}

// From Fortran order (first index fastest) to C order (last index fastest).
std::vector<double> to_c_order(const std::vector<double>& values, const std::vector<std::size_t>& shape) {
  std::vector<double> result(values.size());
  std::vector<std::size_t> index(shape.size(), 0);
  for (double& out : result) {
    std::size_t place = 0;
    for (std::size_t d = shape.size(); d-- > 0;) place = place * shape[d] + index[d];
    out = values[place];
    for (std::size_t d = shape.size(); d-- > 0;) {
      if (++index[d] < shape[d]) break;
      index[d] = 0;
    }
  }
  return result;
}

constexpr std::size_t kMostListNumbers = std::size_t{1} << 22;  // a pickle has at most 2^20 objects
constexpr int kDeepestList = 8;

bool is_list(const PickleNode& node) { return node.kind == PickleKind::kList || node.kind == PickleKind::kTuple; }

// Appends the numbers of a node and of what it holds to `values`; returns their shape. `visits` counts the nodes on the
// way: a file may name one list in many places, and lists of such lists are more numbers than it has bytes.
std::vector<std::size_t> append_numbers(const Pickle& pickle, const PickleNode& node, const std::string& what,
                                        int depth, std::size_t& visits, std::vector<double>& values) {
  if (++visits > kMostListNumbers || values.size() > kMostListNumbers)
    pickle.fail(node.offset, fmt::format("{}: expected lists of at most {} numbers", what, kMostListNumbers));
  if (node.kind == PickleKind::kFloat || node.kind == PickleKind::kInt) {
    values.push_back(node.kind == PickleKind::kFloat ? node.number : static_cast<double>(node.integer));
    return {};
  }
  if (!is_list(node)) {
    const std::vector<double> array = array_values(pickle, node, what);
    values.insert(values.end(), array.begin(), array.end());
    return node.shape;
  }
  if (depth == kDeepestList)
    pickle.fail(node.offset, fmt::format("{}: expected lists at most {} deep", what, kDeepestList));
  std::vector<std::size_t> shape;
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    std::vector<std::size_t> item = append_numbers(pickle, pickle[node.items[i]], what, depth + 1, visits, values);
    if (i > 0 && item != shape)
      pickle.fail(node.offset, fmt::format("{}: expected rows of one shape, found ({}) in row 0 and ({}) in row {}",
                                           what, fmt::join(shape, ", "), fmt::join(item, ", "), i));
    shape = std::move(item);
  }
  shape.insert(shape.begin(), node.items.size());
  return shape;
}

}  // namespace

std::vector<double> array_values(const Pickle& pickle, const PickleNode& node, const std::string& what) {
  if (node.kind != PickleKind::kArray)
    pickle.fail(node.offset, fmt::format("{}: expected a NumPy array, found {}", what, to_string(node.kind)));
  if (!node.built) pickle.fail(node.offset, what + ": the array has no state");
  const PickleNode& dtype = pickle[node.dtype];
  const ItemType type = item_type(pickle, node, dtype, what);
  const std::string bytes = bytes_of(pickle, pickle[node.data], what);
  const std::size_t count = item_count(pickle, node, bytes.size(), type.size, what);
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = type.read(bytes.data() + i * type.size, dtype.byte_order == '>');
  return node.fortran && node.shape.size() > 1 ? to_c_order(values, node.shape) : values;
}

PickleNumbers pickle_numbers(const Pickle& pickle, const PickleNode& node, const std::string& what) {
  PickleNumbers numbers;
  std::size_t visits = 0;
  if (node.kind == PickleKind::kArray || is_list(node) || node.kind == PickleKind::kFloat ||
      node.kind == PickleKind::kInt) {
    numbers.shape = append_numbers(pickle, node, what, 0, visits, numbers.values);
    return numbers;
  }
  pickle.fail(node.offset,
              fmt::format("{}: expected numbers (a NumPy array or lists), found {}", what, to_string(node.kind)));
}

double pickle_number(const Pickle& pickle, const PickleNode& node, const std::string& what) {
  if (node.kind == PickleKind::kText) {
    if (const std::optional<double> number = parse_number(node.text)) return *number;
    pickle.fail(node.offset, fmt::format("{}: expected a number, found '{}'", what, excerpt(node.text)));
  }
  const PickleNumbers numbers = pickle_numbers(pickle, node, what);
  if (numbers.values.size() != 1)
    pickle.fail(node.offset, fmt::format("{}: expected one number, found {}", what, numbers.values.size()));
  return numbers.values.front();
}

}  // namespace duet
