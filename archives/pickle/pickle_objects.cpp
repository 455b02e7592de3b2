#include "duet/archives/pickle/pickle_objects.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <string>
#include <utility>

#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::size_t kMostSizes = 8;
constexpr std::int64_t kLargestOfSizes = std::int64_t{1} << 40;

const PickleNode& member(const Pickle& pickle, std::size_t offset, const PickleNode& object, std::string_view key) {
  if (const PickleNode* node = pickle.find(object, key)) return *node;
  pickle.fail(offset, fmt::format("joblib array: expected a member '{}', found none", key));
}

std::vector<std::size_t> sizes_of(const Pickle& pickle, std::size_t offset, const PickleNode& tuple,
                                  const std::string& what) {
  if (tuple.kind != PickleKind::kTuple)
    pickle.fail(offset, fmt::format("{}: expected a tuple, found {}", what, to_string(tuple.kind)));
  if (tuple.items.size() > kMostSizes)
    pickle.fail(offset,
                fmt::format("{}: expected at most {} dimensions, found {}", what, kMostSizes, tuple.items.size()));
  std::vector<std::size_t> sizes;
  for (const int item : tuple.items) {
    const std::int64_t size = expect_kind(pickle, offset, item, PickleKind::kInt, what).integer;
    if (size < 0 || size > kLargestOfSizes) pickle.fail(offset, fmt::format("{}: {} is out of range", what, size));
    sizes.push_back(static_cast<std::size_t>(size));
  }
  return sizes;
}

// "f4" -> 4, "U12" -> 48.
std::size_t item_bytes(const Pickle& pickle, std::size_t offset, std::string_view type) {
  std::size_t size = 0;
  const std::string_view digits = type.substr(std::min<std::size_t>(1, type.size()));
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), size);
  constexpr std::string_view kKinds = "biufcSUmM";
  const bool known = !type.empty() && kKinds.find(type[0]) != std::string_view::npos && error == std::errc() &&
                     end == digits.data() + digits.size() && size <= 1 << 16;
  if (!known) pickle.fail(offset, fmt::format("joblib array: expected numbers or texts, found type '{}'", shown(type)));
  return type[0] == 'U' ? 4 * size : size;
}

struct StorageType {
  std::string_view name;
  std::string_view type;
};
constexpr std::array<StorageType, 9> kStorageTypes = {{{"FloatStorage", "f4"},
                                                       {"DoubleStorage", "f8"},
                                                       {"HalfStorage", "f2"},
                                                       {"LongStorage", "i8"},
                                                       {"IntStorage", "i4"},
                                                       {"ShortStorage", "i2"},
                                                       {"CharStorage", "i1"},
                                                       {"ByteStorage", "u1"},
                                                       {"BoolStorage", "u1"}}};

}  // namespace

PickleNode joblib_array(const Pickle& pickle, std::size_t offset, const PickleNode& wrapper) {
  PickleNode array{.kind = PickleKind::kArray, .built = true};
  array.shape = sizes_of(pickle, offset, member(pickle, offset, wrapper, "shape"), "shape of a joblib array");
  const PickleNode& order = member(pickle, offset, wrapper, "order");
  if (order.kind != PickleKind::kText || (order.text != "C" && order.text != "F"))
    pickle.fail(offset, fmt::format("memory order of a joblib array: expected 'C' or 'F', found {} '{}'",
                                    to_string(order.kind), shown(order.text)));
  array.fortran = order.text == "F";
  const PickleNode& dtype = member(pickle, offset, wrapper, "dtype");
  if (dtype.kind != PickleKind::kDtype)
    pickle.fail(offset, fmt::format("type of a joblib array: expected a NumPy dtype, found {}", to_string(dtype.kind)));
  array.dtype = static_cast<int>(&dtype - pickle.nodes.data());
  const PickleNode* alignment = pickle.find(wrapper, "numpy_array_alignment_bytes");
  if (alignment != nullptr && alignment->kind == PickleKind::kInt) array.integer = alignment->integer;
  return array;
}

std::size_t array_bytes(const Pickle& pickle, std::size_t offset, const PickleNode& array) {
  std::size_t bytes = item_bytes(pickle, offset, pickle[array.dtype].text);
  for (const std::size_t size : array.shape)
    if (__builtin_mul_overflow(bytes, size, &bytes))
      pickle.fail(offset, fmt::format("joblib array: the shape ({}) is out of range", fmt::join(array.shape, ", ")));
  return bytes;
}

PickleNode empty_dict(const Pickle& pickle, std::size_t offset, const std::vector<int>& arguments) {
  if (arguments.size() > 1)
    pickle.fail(offset, fmt::format("a dict: expected at most 1 argument, found {}", arguments.size()));
  for (const int argument : arguments) {
    const PickleNode& type = expect_kind(pickle, offset, argument, PickleKind::kCallable, "default of a dict");
    if (type.callable != PickleCallable::kBuiltinType)
      pickle.fail(offset, fmt::format("default of a dict: '{}' is refused", shown(type.text)));
  }
  return {.kind = PickleKind::kDict};
}

PickleNode torch_storage(const Pickle& pickle, std::size_t offset, int identity) {
  const std::vector<int>& items = expect_kind(pickle, offset, identity, PickleKind::kTuple, "a torch storage").items;
  if (items.size() != 5) pickle.fail(offset, fmt::format("a torch storage: expected 5 items, found {}", items.size()));
  const PickleNode& type = expect_kind(pickle, offset, items[1], PickleKind::kCallable, "type of a torch storage");
  const PickleNode& count = expect_kind(pickle, offset, items[4], PickleKind::kInt, "size of a torch storage");
  expect_kind(pickle, offset, items[2], PickleKind::kText, "key of a torch storage");
  for (const StorageType& known : kStorageTypes)
    if (type.callable == PickleCallable::kTorchStorage && known.name == type.text)
      return {.kind = PickleKind::kStorage, .integer = count.integer, .text = known.type, .data = items[2]};
  pickle.fail(offset, fmt::format("type of a torch storage: '{}' is refused", shown(type.text)));
}

PickleNode torch_tensor(const Pickle& pickle, std::size_t offset, const std::vector<int>& arguments) {
  if (arguments.size() < 4)
    pickle.fail(offset, fmt::format("a torch tensor: expected at least 4 items, found {}", arguments.size()));
  expect_kind(pickle, offset, arguments[0], PickleKind::kStorage, "storage of a torch tensor");
  PickleNode tensor{.kind = PickleKind::kTensor, .built = true, .data = arguments[0]};
  tensor.integer =
      expect_kind(pickle, offset, arguments[1], PickleKind::kInt, "first number of a torch tensor").integer;
  tensor.shape = sizes_of(pickle, offset, pickle[arguments[2]], "sizes of a torch tensor");
  tensor.strides = sizes_of(pickle, offset, pickle[arguments[3]], "strides of a torch tensor");
  if (tensor.integer < 0 || tensor.integer > kLargestOfSizes || tensor.strides.size() != tensor.shape.size())
    pickle.fail(offset, fmt::format("a torch tensor: {} strides for {} sizes, first number {}", tensor.strides.size(),
                                    tensor.shape.size(), tensor.integer));
  return tensor;
}

}  // namespace duet
