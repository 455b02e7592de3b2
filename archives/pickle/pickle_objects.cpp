#include "duet/archives/pickle/pickle_objects.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string>
#include <utility>

#include "duet/core/require.h"

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
  if (!known)
    pickle.fail(offset, fmt::format("joblib array: expected numbers or texts, found type '{}'", excerpt(type)));
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
                                    to_string(order.kind), excerpt(order.text)));
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
      pickle.fail(offset, fmt::format("default of a dict: '{}' is refused", excerpt(type.text)));
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
  pickle.fail(offset, fmt::format("type of a torch storage: '{}' is refused", excerpt(type.text)));
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

namespace {

constexpr std::size_t kMostDimensions = 8;
constexpr std::int64_t kLargestSize = std::int64_t{1} << 40;

struct KnownCallable {
  std::string_view module;
  std::string_view name;
  PickleCallable callable;
  unsigned flavours = ~0U;  // which may hold it
};

constexpr unsigned bit(PickleFlavour flavour) { return 1U << static_cast<unsigned>(flavour); }
constexpr unsigned kInJoblib = bit(PickleFlavour::kJoblib), kInModel = bit(PickleFlavour::kModel),
                   kInTorch = bit(PickleFlavour::kTorch);

// NumPy 2 moved numpy.core to numpy._core, SciPy 1.8 its matrices; Python 3 renamed __builtin__.
constexpr std::array<KnownCallable, 30> kCallables = {
    {{"numpy.core.multiarray", "_reconstruct", PickleCallable::kReconstruct},
     {"numpy._core.multiarray", "_reconstruct", PickleCallable::kReconstruct},
     {"numpy.core.multiarray", "scalar", PickleCallable::kScalar},
     {"numpy._core.multiarray", "scalar", PickleCallable::kScalar},
     {"numpy.core.numeric", "_frombuffer", PickleCallable::kFromBuffer},
     {"numpy._core.numeric", "_frombuffer", PickleCallable::kFromBuffer},
     {"numpy", "ndarray", PickleCallable::kNdarray},
     {"numpy", "dtype", PickleCallable::kDtype},
     {"_codecs", "encode", PickleCallable::kEncode},
     {"joblib.numpy_pickle", "NumpyArrayWrapper", PickleCallable::kJoblibArray, kInJoblib},
     {"scipy.sparse.csc", "csc_matrix", PickleCallable::kSparse, kInModel},
     {"scipy.sparse._csc", "csc_matrix", PickleCallable::kSparse, kInModel},
     {"scipy.sparse.csr", "csr_matrix", PickleCallable::kSparse, kInModel},
     {"scipy.sparse._csr", "csr_matrix", PickleCallable::kSparse, kInModel},
     {"collections", "defaultdict", PickleCallable::kDictClass, kInJoblib},
     {"collections", "OrderedDict", PickleCallable::kDictClass, kInJoblib | kInTorch},
     {"builtins", "dict", PickleCallable::kBuiltinType, kInJoblib},
     {"builtins", "list", PickleCallable::kBuiltinType, kInJoblib},
     {"__builtin__", "dict", PickleCallable::kBuiltinType, kInJoblib},
     {"__builtin__", "list", PickleCallable::kBuiltinType, kInJoblib},
     {"torch._utils", "_rebuild_tensor_v2", PickleCallable::kTorchTensor, kInTorch},
     {"torch", "FloatStorage", PickleCallable::kTorchStorage, kInTorch},
     {"torch", "DoubleStorage", PickleCallable::kTorchStorage, kInTorch},
     {"torch", "HalfStorage", PickleCallable::kTorchStorage, kInTorch},
     {"torch", "LongStorage", PickleCallable::kTorchStorage, kInTorch},
     {"torch", "IntStorage", PickleCallable::kTorchStorage, kInTorch},
     {"torch", "ShortStorage", PickleCallable::kTorchStorage, kInTorch},
     {"torch", "CharStorage", PickleCallable::kTorchStorage, kInTorch},
     {"torch", "ByteStorage", PickleCallable::kTorchStorage, kInTorch},
     {"torch", "BoolStorage", PickleCallable::kTorchStorage, kInTorch}}};

// The objects of one opcode.
class Objects {
 public:
  Objects(const Pickle& pickle, std::size_t offset) : pickle_(pickle), offset_(offset) {}

  // _reconstruct(ndarray, (0,), b'b'): an empty array that BUILD fills.
  [[nodiscard]] PickleNode reconstruct(const std::vector<int>& arguments) const {
    check_count(arguments, 3, 3, "_reconstruct");
    if (expect(arguments[0], PickleKind::kCallable, "type of an array").callable != PickleCallable::kNdarray)
      fail("type of an array: expected numpy.ndarray");
    return {.kind = PickleKind::kArray};
  }

  // dtype('f8', False, True)
  [[nodiscard]] PickleNode dtype(const std::vector<int>& arguments) const {
    check_count(arguments, 1, 3, "numpy.dtype");
    return {.kind = PickleKind::kDtype, .text = expect(arguments[0], PickleKind::kText, "numpy.dtype").text};
  }

  // scalar(dtype, b'...')
  [[nodiscard]] PickleNode scalar(const std::vector<int>& arguments) const {
    check_count(arguments, 2, 2, "NumPy scalar");
    expect(arguments[0], PickleKind::kDtype, "type of a NumPy scalar");
    expect(arguments[1], PickleKind::kBytes, "value of a NumPy scalar");
    return {.kind = PickleKind::kArray, .built = true, .dtype = arguments[0], .data = arguments[1]};
  }

  // _frombuffer(bytearray, dtype, shape, 'C')
  [[nodiscard]] PickleNode from_buffer(const std::vector<int>& arguments) const {
    check_count(arguments, 4, 4, "_frombuffer");
    expect(arguments[0], PickleKind::kBytes, "values of an array");
    expect(arguments[1], PickleKind::kDtype, "type of an array");
    const std::string_view order = expect(arguments[3], PickleKind::kText, "memory order of an array").text;
    if (order != "C" && order != "F")
      fail(fmt::format("memory order of an array: expected C or F, found '{}'", excerpt(order)));
    return {.kind = PickleKind::kArray,
            .built = true,
            .fortran = order == "F",
            .dtype = arguments[1],
            .data = arguments[0],
            .shape = shape_of(arguments[2])};
  }

  // _codecs.encode('...', 'latin1'): how protocol 2 stores bytes.
  [[nodiscard]] PickleNode encode(const std::vector<int>& arguments) const {
    check_count(arguments, 2, 2, "_codecs.encode");
    const std::string_view codec = expect(arguments[1], PickleKind::kText, "codec").text;
    if (codec != "latin1") fail(fmt::format("codec: expected 'latin1', found '{}'", excerpt(codec)));
    return {.kind = PickleKind::kBytes,
            .text = expect(arguments[0], PickleKind::kText, "encoded bytes").text,
            .latin1_text = true};
  }

  // (version, byte order, subtype, names, fields, item size, alignment, flags)
  void build_dtype(PickleNode& dtype, const std::vector<int>& state) const {
    check_count(state, 8, 9, "state of numpy.dtype");
    const std::string_view order = expect(state[1], PickleKind::kText, "byte order").text;
    if (order != "<" && order != ">" && order != "|")
      fail(fmt::format("byte order: expected '<', '>' or '|', found '{}'", excerpt(order)));
    for (const int part : {2, 3, 4}) expect(state[part], PickleKind::kNone, "fields of a structured dtype");
    dtype.byte_order = order[0];
  }

  // (version, shape, dtype, is Fortran order, bytes)
  void build_array(PickleNode& array, const std::vector<int>& state) const {
    check_count(state, 5, 5, "state of an array");
    if (array.built) fail("an array is built twice");
    expect(state[2], PickleKind::kDtype, "type of an array");
    const bool objects = pickle_[state[4]].kind == PickleKind::kList;
    if (objects && pickle_.flavour != PickleFlavour::kObjects) fail("an array of Python objects is refused");
    if (!objects && !pickle_[state[4]].old_text) expect(state[4], PickleKind::kBytes, "values of an array");
    array.fortran = expect(state[3], PickleKind::kBool, "memory order of an array").integer != 0;
    array.shape = shape_of(state[1]);
    array.dtype = state[2];
    array.data = state[4];
    array.built = true;
  }

  [[noreturn]] void fail(const std::string& fault) const { pickle_.fail(offset_, fault); }

 private:
  const PickleNode& expect(int node, PickleKind kind, std::string_view what) const {
    return expect_kind(pickle_, offset_, node, kind, what);
  }

  void check_count(const std::vector<int>& items, std::size_t least, std::size_t most, std::string_view what) const {
    if (items.size() < least || items.size() > most)
      fail(fmt::format("{}: expected {} items, found {}", what, most, items.size()));
  }

  [[nodiscard]] std::vector<std::size_t> shape_of(int tuple) const {
    const std::vector<int>& sizes = expect(tuple, PickleKind::kTuple, "shape of an array").items;
    if (sizes.size() > kMostDimensions)
      fail(fmt::format("shape of an array: expected at most {} dimensions, found {}", kMostDimensions, sizes.size()));
    std::vector<std::size_t> shape;
    for (const int size : sizes) {
      const std::int64_t value = expect(size, PickleKind::kInt, "shape of an array").integer;
      if (value < 0 || value > kLargestSize) fail(fmt::format("shape of an array: size {} is out of range", value));
      shape.push_back(static_cast<std::size_t>(value));
    }
    return shape;
  }

  const Pickle& pickle_;
  std::size_t offset_;
};

}  // namespace

PickleCallable find_callable(const Pickle& pickle, std::size_t offset, std::string_view module, std::string_view name) {
  for (const KnownCallable& known : kCallables)
    if (known.module == module && known.name == name && (known.flavours & bit(pickle.flavour)) != 0)
      return known.callable;
  pickle.fail(offset, fmt::format("'{}.{}' is refused: expected only what NumPy arrays need (numpy.ndarray, "
                                  "numpy.dtype, their reconstruction); nothing in the file is executed",
                                  excerpt(module), excerpt(name)));
}

PickleNode reduced(const Pickle& pickle, std::size_t offset, PickleCallable callable,
                   const std::vector<int>& arguments) {
  const Objects objects(pickle, offset);
  switch (callable) {
    case PickleCallable::kReconstruct:
      return objects.reconstruct(arguments);
    case PickleCallable::kDtype:
      return objects.dtype(arguments);
    case PickleCallable::kScalar:
      return objects.scalar(arguments);
    case PickleCallable::kFromBuffer:
      return objects.from_buffer(arguments);
    case PickleCallable::kEncode:
      return objects.encode(arguments);
    case PickleCallable::kDictClass:
      return empty_dict(pickle, offset, arguments);
    case PickleCallable::kTorchTensor:
      return torch_tensor(pickle, offset, arguments);
    case PickleCallable::kNdarray:
      objects.fail("a direct call of numpy.ndarray is refused: expected _reconstruct");
    default:
      break;
  }
  objects.fail("a call of a class is refused: expected a function that rebuilds an array");
}

void build_object(Pickle& pickle, std::size_t offset, int object, const std::vector<int>& state) {
  const Objects objects(pickle, offset);
  PickleNode& node = pickle.nodes[object];
  if (node.kind == PickleKind::kDtype)
    objects.build_dtype(node, state);
  else if (node.kind == PickleKind::kArray)
    objects.build_array(node, state);
  else
    objects.fail(fmt::format("expected an array or a dtype to build, found {}", to_string(node.kind)));
}

}  // namespace duet
