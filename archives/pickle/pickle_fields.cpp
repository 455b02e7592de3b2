#include "duet/archives/pickle/pickle_fields.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

std::string expected_table_text(std::size_t frames, const std::vector<std::size_t>& rest) {
  std::string text = frames == 0 ? "(T" : fmt::format("({}", frames);
  for (const std::size_t size : rest) text += size == 0 ? ", n" : fmt::format(", {}", size);
  return text + ")";
}

}  // namespace

PickleDict::PickleDict(const Pickle& pickle, const PickleNode& node) : pickle_(pickle) {
  if (node.kind != PickleKind::kDict)
    pickle.fail(node.offset, fmt::format("expected a dict, found {}", to_string(node.kind)));
  for (std::size_t i = 0; i + 1 < node.items.size(); i += 2) add(pickle[node.items[i]], node.items[i + 1]);
}

const PickleNode* PickleDict::find(const std::string& key) const {
  const auto found = values_.find(key);
  if (found == values_.end() || pickle_[found->second].kind == PickleKind::kNone) return nullptr;
  return &pickle_[found->second];
}

const PickleNode& PickleDict::get(const std::string& key) const {
  if (const PickleNode* node = find(key)) return *node;
  throw InputError(fmt::format("'{}': missing key '{}'; keys found: {}", pickle_.name, key,
                               shown(fmt::format("{}", fmt::join(keys(), ", ")), kShownSentence)));
}

std::vector<std::string> PickleDict::keys() const {
  std::vector<std::string> names;
  for (const auto& [name, node] : values_) names.push_back(name);
  return names;
}

void PickleDict::add(const PickleNode& key, int value) {
  if (key.kind != PickleKind::kText)
    pickle_.fail(key.offset, fmt::format("expected a string as key, found {}", to_string(key.kind)));
  const std::string name(key.text);
  if (!values_.emplace(name, value).second)
    pickle_.fail(key.offset, fmt::format("key '{}' is there twice", shown(name)));
}

PickleTable pickle_table(const Pickle& pickle, const PickleNode& node, const std::string& key, std::size_t frames,
                         const std::vector<std::size_t>& rest) {
  const std::string what = "key '" + key + "'";
  PickleNumbers numbers = pickle_numbers(pickle, node, what);
  const std::vector<std::size_t>& shape = numbers.shape;
  bool fits = shape.size() == rest.size() + 1 && (frames == 0 || shape[0] == frames);
  for (std::size_t d = 0; fits && d < rest.size(); ++d)
    fits = rest[d] == 0 ? shape[d + 1] > 0 : shape[d + 1] == rest[d];
  if (!fits)
    pickle.fail(node.offset, fmt::format("{}: expected shape {}, found ({})", what, expected_table_text(frames, rest),
                                         fmt::join(shape, ", ")));
  PickleTable table{.rows = shape[0], .values = std::move(numbers.values)};
  if (table.rows < 2 || table.rows > 100'000'000)
    pickle.fail(node.offset, fmt::format("{}: expected at least 2 frames, found {}", what, table.rows));
  table.row_size = table.values.size() / table.rows;
  for (std::size_t i = 0; i < table.values.size(); ++i)
    if (!std::isfinite(table.values[i]))
      pickle.fail(node.offset,
                  fmt::format("{}: frame {}, number {} is not finite", what, i / table.row_size, i % table.row_size));
  return table;
}

double pickle_rate(const Pickle& pickle, const PickleNode& node) {
  const double rate_hz = pickle_number(pickle, node, "key 'fps'");
  if (!std::isfinite(rate_hz) || rate_hz <= 0.0)
    pickle.fail(node.offset, fmt::format("key 'fps': expected a positive rate, found {}", rate_hz));
  return rate_hz;
}

}  // namespace duet
