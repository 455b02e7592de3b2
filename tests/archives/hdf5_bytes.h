// Files of HDF5 for tests, as h5py writes them: superblock of version 0, names in a tree, each array in one piece.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace duet::test {

struct Hdf5TestArray {
  std::string name;
  std::vector<std::uint64_t> shape;
  std::vector<double> values;
};

struct Hdf5TestForm {
  std::size_t names_in_leaf = 8;
  std::size_t children_of_node = 32;
};

class Hdf5Writer {
 public:
  // Names in their order, as the tree has them.
  static std::string bytes(std::vector<Hdf5TestArray> arrays, const Hdf5TestForm& form = {}) {
    std::sort(arrays.begin(), arrays.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
    Hdf5Writer out;
    out.bytes_.assign(96, '\0');
    std::vector<std::uint64_t> headers;
    for (const Hdf5TestArray& array : arrays) headers.push_back(out.put_array(array));
    const std::uint64_t heap = out.put_heap(arrays);
    const std::uint64_t tree = out.put_tree(headers, form);
    const std::uint64_t root = out.bytes_.size();
    out.put(1, 2).put(1, 2).put(1, 4).put(24, 4).put(0, 4);
    out.put(0x11, 2).put(16, 2).put(0, 4).put(tree, 8).put(heap, 8);
    return out.with_superblock(root);
  }

 private:
  Hdf5Writer& put(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes_ += static_cast<char>(i < 8 ? value >> (8 * i) : 0);
    return *this;
  }

  std::uint64_t put_array(const Hdf5TestArray& array) {
    const std::uint64_t data = bytes_.size();
    for (const double value : array.values) put(std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
    const std::uint64_t header = bytes_.size(), rank = array.shape.size();
    const std::uint64_t space = 8 + 8 * rank;
    put(1, 2).put(3, 2).put(1, 4).put(24 + space + 24 + 24, 4).put(0, 4);
    put(0x01, 2).put(space, 2).put(0, 4).put(1, 1).put(rank, 1).put(0, 6);
    for (const std::uint64_t size : array.shape) put(size, 8);
    put(0x03, 2).put(24, 2).put(0, 4).put(0x11, 1).put(0x1f20, 3).put(4, 4);
    put(0, 2).put(32, 2).put(23, 1).put(8, 1).put(0, 1).put(23, 1).put(127, 4).put(0, 4);
    put(0x08, 2).put(24, 2).put(0, 4).put(3, 1).put(1, 1).put(data, 8).put(4 * array.values.size(), 8).put(0, 6);
    return header;
  }

  std::uint64_t put_heap(const std::vector<Hdf5TestArray>& arrays) {
    std::string names(8, '\0');
    for (const Hdf5TestArray& array : arrays) {
      names_.push_back(names.size());
      names += array.name;
      names.resize(names.size() / 8 * 8 + 8);
    }
    const std::uint64_t data = bytes_.size();
    bytes_ += names;
    const std::uint64_t heap = bytes_.size();
    bytes_ += "HEAP";
    put(0, 4).put(names.size(), 8).put(~std::uint64_t{0}, 8).put(data, 8);
    return heap;
  }

  struct Node {
    std::uint64_t begin, last_name;
  };

  std::uint64_t put_tree(const std::vector<std::uint64_t>& headers, const Hdf5TestForm& form) {
    std::vector<Node> nodes;
    for (std::size_t i = 0; i < headers.size(); i += form.names_in_leaf) {
      const std::size_t end = std::min(i + form.names_in_leaf, headers.size());
      nodes.push_back({bytes_.size(), names_[end - 1]});
      bytes_ += "SNOD";
      put(1, 2).put(end - i, 2);
      for (std::size_t k = i; k < end; ++k) put(names_[k], 8).put(headers[k], 8).put(0, 24);
    }
    for (int level = 0;; ++level) {
      std::vector<Node> above;
      for (std::size_t i = 0; i < nodes.size() || above.empty(); i += form.children_of_node) {
        const std::size_t end = std::min(i + form.children_of_node, nodes.size());
        above.push_back({bytes_.size(), end == 0 ? 0 : nodes[end - 1].last_name});
        bytes_ += "TREE";
        put(0, 1).put(static_cast<std::uint64_t>(level), 1).put(end - i, 2).put(~std::uint64_t{0}, 8);
        put(~std::uint64_t{0}, 8).put(i == 0 ? 0 : nodes[i - 1].last_name, 8);
        for (std::size_t k = i; k < end; ++k) put(nodes[k].begin, 8).put(nodes[k].last_name, 8);
      }
      nodes = std::move(above);
      if (nodes.size() == 1) return nodes[0].begin;
    }
  }

  std::string with_superblock(std::uint64_t root) {
    Hdf5Writer head;
    head.bytes_ = "\x89HDF\r\n\x1a\n";
    head.put(0, 5).put(8, 1).put(8, 1).put(0, 1).put(4, 2).put(16, 2).put(0, 4);
    head.put(0, 8).put(~std::uint64_t{0}, 8).put(bytes_.size(), 8).put(~std::uint64_t{0}, 8);
    head.put(0, 8).put(root, 8).put(0, 24);
    return head.bytes_ + bytes_.substr(head.bytes_.size());
  }

  std::string bytes_;
  std::vector<std::uint64_t> names_;  // where in the heap
};

}  // namespace duet::test
