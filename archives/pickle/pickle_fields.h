// Dicts of arrays inside a pickle, read key by key. All functions throw InputError naming file, byte, key, expected and
// found.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "duet/archives/pickle/pickle_node.h"

namespace duet {

// A dict whose keys are strings. Keeps a reference: the pickle must outlive it.
class PickleDict {
 public:
  PickleDict(const Pickle& pickle, const PickleNode& node);

  // nullptr where the key is absent or None.
  [[nodiscard]] const PickleNode* find(const std::string& key) const;
  [[nodiscard]] const PickleNode& get(const std::string& key) const;
  [[nodiscard]] std::vector<std::string> keys() const;  // sorted

 private:
  void add(const PickleNode& key, int value);

  const Pickle& pickle_;
  std::map<std::string, int> values_;
};

struct PickleTable {
  std::size_t rows = 0;
  std::size_t row_size = 0;
  std::vector<double> values;  // row by row, finite
};

// An array, or lists, of `frames` rows (0: any number of at least 2) of shape `rest` (0: any size), all finite.
PickleTable pickle_table(const Pickle& pickle, const PickleNode& node, const std::string& key, std::size_t frames,
                         const std::vector<std::size_t>& rest);

// One number in any of the ways of pickle_number: frames per second, above 0.
double pickle_rate(const Pickle& pickle, const PickleNode& node);

}  // namespace duet
