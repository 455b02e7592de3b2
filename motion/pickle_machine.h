// The part of Python's pickle format (protocols 2 to 5) that dicts of NumPy arrays, numbers, strings and lists use. A
// file builds passive nodes and nothing else: no class is ever looked up, and no call made, beyond the six names of
// NumPy's own array pickles. Work and memory are linear in the size of the file; nothing recurses. Thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

enum class PickleKind { kNone, kBool, kInt, kFloat, kText, kBytes, kTuple, kList, kDict, kCallable, kDtype, kArray };

enum class PickleCallable { kReconstruct, kNdarray, kDtype, kScalar, kFromBuffer, kEncode };

// One value of the file. Views are into the bytes that were parsed.
struct PickleNode {
  PickleKind kind = PickleKind::kNone;
  std::size_t offset = 0;       // of the opcode that made it, for messages
  std::int64_t integer = 0;     // kBool, kInt
  double number = 0.0;          // kFloat
  std::string_view text = {};   // kText (UTF-8), kBytes; kDtype: "f4", ...
  bool latin1_text = false;     // kBytes: `text` is UTF-8 whose code points are the bytes (protocol 2)
  std::vector<int> items = {};  // kTuple, kList: nodes; kDict: key, value, key, value, ...
  PickleCallable callable{};    // kCallable
  char byte_order = '\0';       // kDtype: '<', '>' or '|' once built
  // kArray, once built:
  bool built = false;
  bool fortran = false;
  int dtype = -1;
  int data = -1;
  std::vector<std::size_t> shape = {};  // empty for a scalar
};

struct Pickle {
  std::string name;  // file name, for messages
  std::vector<PickleNode> nodes;
  int root = 0;

  // Throws InputError naming file and byte.
  [[noreturn]] void fail(std::size_t offset, const std::string& fault) const;
  [[nodiscard]] const PickleNode& operator[](int node) const { return nodes[node]; }
};

// `bytes` must outlive the result. Throws InputError naming file, byte offset, expected and found.
Pickle parse_pickle(std::string_view bytes, const std::string& name);

std::string_view to_string(PickleKind kind);

// Values of an array or NumPy scalar of f4, f8, i4 or i8, in C order. `what` stands in messages. Throws InputError for
// another node or type, or a size that does not match the shape.
std::vector<double> array_values(const Pickle& pickle, const PickleNode& node, const std::string& what);

}  // namespace duet
