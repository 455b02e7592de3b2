// Entries that a program adds by name to those that duet has: controllers, policies, metrics of its own. Thread-safe;
// an entry stays for as long as the program runs, at one address.
#pragma once

#include <algorithm>
#include <deque>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/core/require.h"

namespace duet {

// `Entry` has a `name`.
template <typename Entry>
class OpenRegistry {
 public:
  // Throws std::invalid_argument for a name that is empty, ends in ".yaml" (a descriptor's), or is there already, here
  // or in `shipped`; `kind` ("controller") is what messages call it.
  void add(std::string_view kind, Entry entry, const std::vector<std::string>& shipped) {
    const std::string name(entry.name), called = std::string(kind) + " '" + name + "'";
    require(!name.empty(), std::string(kind) + ": expected a name, found none");
    require(!name.ends_with(".yaml"), called + ": a name that ends in .yaml is the path of a descriptor");
    const std::lock_guard lock(mutex_);
    const bool taken = std::find(shipped.begin(), shipped.end(), name) != shipped.end() || find_locked(name) != nullptr;
    require(!taken, called + " is there already: choose another name");
    entries_.push_back(std::move(entry));
  }

  // Null where there is none.
  [[nodiscard]] const Entry* find(std::string_view name) const {
    const std::lock_guard lock(mutex_);
    return find_locked(name);
  }

  // In the order in which they were added.
  [[nodiscard]] std::vector<const Entry*> all() const {
    const std::lock_guard lock(mutex_);
    std::vector<const Entry*> entries;
    for (const Entry& entry : entries_) entries.push_back(&entry);
    return entries;
  }

 private:
  const Entry* find_locked(std::string_view name) const {
    for (const Entry& entry : entries_)
      if (entry.name == name) return &entry;
    return nullptr;
  }

  mutable std::mutex mutex_;
  std::deque<Entry> entries_;
};

}  // namespace duet
