#include "duet/archives/pickle/pickle_node.h"

#include <fmt/format.h>

#include "duet/core/require.h"

namespace duet {

void Pickle::fail(std::size_t offset, const std::string& fault) const {
  throw InputError(fmt::format("'{}': byte {}: {}", name, offset, fault));
}

const PickleNode* Pickle::find(const PickleNode& dict, std::string_view key) const {
  if (dict.kind != PickleKind::kDict && dict.kind != PickleKind::kObject) return nullptr;
  for (std::size_t i = dict.items.size(); i >= 2; i -= 2) {
    const PickleNode& name = nodes[dict.items[i - 2]];
    if (name.kind == PickleKind::kText && name.text == key) return &nodes[dict.items[i - 1]];
  }
  return nullptr;
}

std::string_view to_string(PickleKind kind) {
  switch (kind) {
    case PickleKind::kNone:
      return "None";
    case PickleKind::kBool:
      return "a bool";
    case PickleKind::kInt:
      return "an integer";
    case PickleKind::kFloat:
      return "a float";
    case PickleKind::kText:
      return "a string";
    case PickleKind::kBytes:
      return "bytes";
    case PickleKind::kTuple:
      return "a tuple";
    case PickleKind::kList:
      return "a list";
    case PickleKind::kDict:
      return "a dict";
    case PickleKind::kCallable:
      return "a class or function";
    case PickleKind::kDtype:
      return "a NumPy dtype";
    case PickleKind::kArray:
      return "a NumPy array";
    case PickleKind::kObject:
      return "an object";
    case PickleKind::kStorage:
      return "a torch storage";
    case PickleKind::kTensor:
      return "a torch tensor";
  }
  return "";
}

const PickleNode& expect_kind(const Pickle& pickle, std::size_t offset, int node, PickleKind kind,
                              std::string_view what) {
  const PickleNode& value = pickle[node];
  if (value.kind != kind)
    pickle.fail(offset, fmt::format("{}: expected {}, found {}", what, to_string(kind), to_string(value.kind)));
  return value;
}

}  // namespace duet
