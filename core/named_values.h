// Values by name, as std::map has them, for rows by the million: the names of rows of one kind are the same, so that
// many objects share them, and an object without values is one pointer. Sorted by name. A change of the names copies
// them; values change in place. Thread-safe as std::map is.
#pragma once

#include <algorithm>
#include <compare>
#include <cstddef>
#include <initializer_list>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/core/task.h"

namespace duet {

using SortedNames = std::vector<std::string>;
// shared_ptr: nobody knows which of the objects that share names lives longest.
using SharedNames = std::shared_ptr<const SortedNames>;

// Lists of names, and tags, that were met so far, each once.
class NamePool {
 public:
  SharedNames shared(const SharedNames& names) { return *known_.insert(names).first; }
  std::shared_ptr<const Tags> shared(const std::shared_ptr<const Tags>& tags) { return *tags_.insert(tags).first; }

 private:
  struct IsBefore {
    template <typename Shared>
    bool operator()(const Shared& a, const Shared& b) const {
      return *a < *b;
    }
  };
  std::set<SharedNames, IsBefore> known_;
  std::set<std::shared_ptr<const Tags>, IsBefore> tags_;
};

template <typename T>
class NamedValues {
 public:
  using value_type = std::pair<const std::string, T>;
  using reference = std::pair<const std::string&, const T&>;

  class const_iterator {
   public:
    using iterator_category = std::input_iterator_tag;
    using value_type = NamedValues::value_type;
    using difference_type = std::ptrdiff_t;
    using reference = NamedValues::reference;
    struct pointer {
      reference entry;
      const reference* operator->() const { return &entry; }
    };

    const_iterator() = default;
    const_iterator(const std::string* name, const T* value) : name_(name), value_(value) {}
    reference operator*() const { return {*name_, *value_}; }
    pointer operator->() const { return {**this}; }
    const_iterator& operator++() {
      ++name_;
      ++value_;
      return *this;
    }
    const_iterator operator++(int) { return std::exchange(*this, const_iterator(name_ + 1, value_ + 1)); }
    bool operator==(const const_iterator& other) const { return name_ == other.name_; }

   private:
    const std::string* name_ = nullptr;
    const T* value_ = nullptr;
  };
  using iterator = const_iterator;

  NamedValues() = default;
  NamedValues(const std::map<std::string, T>& values) {  // NOLINT(google-explicit-constructor): the same as a value
    if (values.empty()) return;
    SortedNames names;
    for (const auto& [name, value] : values) names.push_back(name);
    hold(std::make_shared<const SortedNames>(std::move(names)));
    std::ranges::transform(values, block_->values.get(), [](const auto& entry) { return entry.second; });
  }
  NamedValues(std::initializer_list<value_type> values) : NamedValues(std::map<std::string, T>(values)) {}
  NamedValues(const NamedValues& other) { *this = other; }
  NamedValues(NamedValues&&) noexcept = default;
  NamedValues& operator=(NamedValues&&) noexcept = default;
  NamedValues& operator=(const NamedValues& other) {
    if (this == &other) return *this;
    block_.reset();
    if (other.empty()) return *this;
    hold(other.block_->names);
    std::copy_n(other.block_->values.get(), size(), block_->values.get());
    return *this;
  }
  ~NamedValues() = default;

  [[nodiscard]] std::size_t size() const { return block_ ? block_->names->size() : 0; }
  [[nodiscard]] bool empty() const { return size() == 0; }
  [[nodiscard]] const_iterator begin() const { return at_place(0); }
  [[nodiscard]] const_iterator end() const { return at_place(size()); }
  [[nodiscard]] const_iterator lower_bound(std::string_view name) const { return at_place(place_of(name)); }
  [[nodiscard]] const_iterator find(std::string_view name) const { return has(name) ? lower_bound(name) : end(); }
  [[nodiscard]] bool contains(std::string_view name) const { return has(name); }
  // Throws std::out_of_range.
  [[nodiscard]] const T& at(std::string_view name) const {
    if (!has(name)) throw std::out_of_range("no value '" + std::string(name) + "'");
    return block_->values[place_of(name)];
  }

  T& operator[](std::string_view name) {
    if (!has(name)) {
      std::map<std::string, T> values = map();
      values.emplace(name, T{});
      *this = NamedValues(values);
    }
    return block_->values[place_of(name)];
  }
  void erase(std::string_view name) {
    std::map<std::string, T> values = map();
    values.erase(std::string(name));
    *this = NamedValues(values);
  }
  void clear() { block_.reset(); }
  [[nodiscard]] std::map<std::string, T> map() const { return std::map<std::string, T>(begin(), end()); }
  // Takes the pool's names in the place of its own, which are the same.
  void share_names(NamePool& pool) {
    if (block_) block_->names = pool.shared(block_->names);
  }

  bool operator==(const NamedValues& other) const {
    return std::equal(begin(), end(), other.begin(), other.end(), [](const auto& a, const auto& b) { return a == b; });
  }

 private:
  struct Block {
    SharedNames names;
    std::unique_ptr<T[]> values;  // one for each name
  };

  void hold(SharedNames names) {
    const std::size_t count = names->size();
    block_ = std::make_unique<Block>(Block{std::move(names), std::make_unique<T[]>(count)});
  }
  [[nodiscard]] std::size_t place_of(std::string_view name) const {
    if (!block_) return 0;
    return static_cast<std::size_t>(
        std::ranges::lower_bound(*block_->names, name, {},
                                 [](const std::string& known) { return std::string_view(known); }) -
        block_->names->begin());
  }
  [[nodiscard]] bool has(std::string_view name) const {
    const std::size_t place = place_of(name);
    return place < size() && (*block_->names)[place] == name;
  }
  [[nodiscard]] const_iterator at_place(std::size_t place) const {
    if (!block_) return {};
    return {block_->names->data() + place, block_->values.get() + place};
  }

  std::unique_ptr<Block> block_;  // none without values
};

using NamedNumbers = NamedValues<double>;
using NamedFlags = NamedValues<bool>;

}  // namespace duet
