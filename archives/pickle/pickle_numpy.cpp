#include "duet/archives/pickle/pickle_numpy.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "duet/archives/pickle/pickle_objects.h"
#include "duet/core/text.h"

namespace duet {
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
      fail(fmt::format("memory order of an array: expected C or F, found '{}'", shown(order)));
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
    if (codec != "latin1") fail(fmt::format("codec: expected 'latin1', found '{}'", shown(codec)));
    return {.kind = PickleKind::kBytes,
            .text = expect(arguments[0], PickleKind::kText, "encoded bytes").text,
            .latin1_text = true};
  }

  // (version, byte order, subtype, names, fields, item size, alignment, flags)
  void build_dtype(PickleNode& dtype, const std::vector<int>& state) const {
    check_count(state, 8, 9, "state of numpy.dtype");
    const std::string_view order = expect(state[1], PickleKind::kText, "byte order").text;
    if (order != "<" && order != ">" && order != "|")
      fail(fmt::format("byte order: expected '<', '>' or '|', found '{}'", shown(order)));
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
                                  shown(module), shown(name)));
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
