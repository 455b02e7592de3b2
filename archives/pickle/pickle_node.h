// The values that a pickle file holds, once parsed (archives/pickle/pickle_machine.h): passive nodes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

enum class PickleKind {
  kNone,
  kBool,
  kInt,
  kFloat,
  kText,
  kBytes,
  kTuple,
  kList,
  kDict,
  kCallable,
  kDtype,
  kArray,
  kObject,   // of a class that is known and passive: its members, never its methods
  kStorage,  // numbers that stand in another entry of a torch archive
  kTensor
};

enum class PickleCallable {
  kReconstruct,
  kNdarray,
  kDtype,
  kScalar,
  kFromBuffer,
  kEncode,
  kJoblibArray,
  kSparse,
  kDictClass,
  kBuiltinType,
  kTorchStorage,
  kTorchTensor
};

// The writer of the stream, which decides the names it may hold; ask for the smallest that fits.
enum class PickleFlavour {
  kNumPy,    // dicts, lists, numbers, texts, NumPy arrays
  kObjects,  // and arrays of such things (what NumPy puts into an NPY file of objects)
  kJoblib,   // NumPy's and joblib's arrays, whose bytes stand in the stream
  kModel,    // and SciPy's sparse matrices and the texts of Python 2 (body models)
  kTorch     // data.pkl of torch.save
};

// One value of the file. Views are into the bytes that were parsed.
struct PickleNode {
  PickleKind kind = PickleKind::kNone;
  std::size_t offset = 0;       // of the opcode that made it, for messages
  std::int64_t integer = 0;     // kBool, kInt
  double number = 0.0;          // kFloat
  std::string_view text = {};   // kText (UTF-8), kBytes; kDtype, kStorage: "f4", ...; kObject: "csc_matrix", ...
  bool latin1_text = false;     // kBytes: `text` is UTF-8 whose code points are the bytes (protocol 2)
  bool old_text = false;        // kText: of Python 2, which has one type for texts and bytes
  std::vector<int> items = {};  // kTuple, kList: nodes; kDict, kObject: key, value, key, value, ...
  PickleCallable callable{};    // kCallable; kObject: its class
  char byte_order = '\0';       // kDtype: '<', '>' or '|' once built
  // kArray, once built; kObject:
  bool built = false;
  bool fortran = false;
  int dtype = -1;
  int data = -1;                          // kArray: its bytes (or its list, of objects); kTensor: its kStorage
  std::vector<std::size_t> shape = {};    // empty for a scalar; also of a kTensor
  std::vector<std::size_t> strides = {};  // kTensor, in numbers; `integer` is its first one's place
};

struct Pickle {
  std::string name;  // file name, for messages
  std::vector<PickleNode> nodes;
  int root = 0;
  PickleFlavour flavour = PickleFlavour::kNumPy;
  std::unique_ptr<const std::string> owned = {};  // what the views are into, where the file was compressed

  // Throws InputError naming file and byte.
  [[noreturn]] void fail(std::size_t offset, const std::string& fault) const;
  [[nodiscard]] const PickleNode& operator[](int node) const { return nodes[node]; }
  // The value of a text key of a dict or object, the last where it stands there twice; nullptr where it has none.
  [[nodiscard]] const PickleNode* find(const PickleNode& dict, std::string_view key) const;
};

std::string_view to_string(PickleKind kind);

// The node where it is of the kind, else throws: "`what`: expected `kind`, found ...".
const PickleNode& expect_kind(const Pickle& pickle, std::size_t offset, int node, PickleKind kind,
                              std::string_view what);

}  // namespace duet
