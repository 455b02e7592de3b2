#include "duet/people/hdf5/hdf5.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "duet/archives/npy/npy.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kMostEntries = 4'000'000;  // of all nodes of a tree: 3,000,000 names
constexpr std::uint64_t kMostNameBytes = std::uint64_t{256} << 20;

struct NamedObject {
  std::string name;
  std::uint64_t header = 0;
};

// A group as a tree of names (HDF5 before 1.8, and h5py today).
class NameTree {
 public:
  NameTree(Hdf5Bytes& file, std::uint64_t heap) : file_(file), names_(heap_of(file, heap)) {}

  // All of them, or the one that is called `wanted`, which the keys of the tree lead to.
  std::vector<NamedObject> objects(std::uint64_t tree, const std::string* wanted) {
    visit(tree, -1, wanted);
    return std::move(found_);
  }

 private:
  static std::string heap_of(Hdf5Bytes& file, std::uint64_t begin) {
    Hdf5Block head = file.block(begin, 32);
    head.expect("HEAP");
    head.skip(4);
    const std::uint64_t size = head.number(8);
    head.skip(8);
    if (size > kMostNameBytes) head.fail(fmt::format("{} bytes of names are above {}", size, kMostNameBytes));
    return std::string(file.block(head.number(8), size).take(size));
  }

  std::string name_at(std::uint64_t offset, const Hdf5Block& asks) {
    const std::size_t end = offset < names_.size() ? names_.find('\0', offset) : std::string::npos;
    if (end == std::string::npos) asks.fail(fmt::format("expected a name at {} of {} bytes", offset, names_.size()));
    return names_.substr(offset, end - offset);
  }

  void visit(std::uint64_t begin, int level, const std::string* wanted) {
    Hdf5Block head = file_.block(begin, 24);
    head.expect("TREE");
    if (head.number(1) != 0) head.fail("expected a tree of names");
    const int found = static_cast<int>(head.number(1));
    const std::uint64_t count = head.number(2);
    entries_ += count + 1;
    if ((level >= 0 && found != level) || entries_ > kMostEntries) head.fail("the tree of names is none");
    Hdf5Block block = file_.block(begin + 24, count * 16 + 8);
    block.skip(8);  // the key before the first child: names of child i are above key i and not above key i + 1
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint64_t child = block.number(8), key = block.number(8);
      if (wanted != nullptr && *wanted > name_at(key, block)) continue;
      if (found > 0)
        visit(child, found - 1, wanted);
      else
        visit_leaf(child, wanted);
      if (wanted != nullptr) return;
    }
  }

  void visit_leaf(std::uint64_t begin, const std::string* wanted) {
    constexpr std::uint64_t kEntryBytes = 40;
    Hdf5Block head = file_.block(begin, 8);
    head.expect("SNOD");
    head.skip(2);
    const std::uint64_t count = head.number(2);
    Hdf5Block block = file_.block(begin + 8, count * kEntryBytes);
    for (std::uint64_t i = 0; i < count; ++i) {
      NamedObject object;
      object.name = name_at(block.number(8), block);
      object.header = block.number(8);
      block.skip(kEntryBytes - 16);
      if (wanted == nullptr || object.name == *wanted) found_.push_back(std::move(object));
    }
    entries_ += count + 1;
    if (entries_ > kMostEntries) head.fail("the tree of names is none");
  }

  Hdf5Bytes& file_;
  std::string names_;  // each ends in a zero
  std::size_t entries_ = 0;
  std::vector<NamedObject> found_;
};

// A name in the header of its group (small groups of HDF5 1.8 and later).
NamedObject object_of_link(const Hdf5Header& header, const Hdf5Message& message) {
  Hdf5Block block(header.file, message.begin, message.bytes);
  block.skip(1);
  const std::uint64_t flags = block.number(1);
  const std::uint64_t kind = (flags & 0x08) != 0 ? block.number(1) : 0;
  block.skip(((flags & 0x04) != 0 ? 8 : 0) + ((flags & 0x10) != 0 ? 1 : 0));
  NamedObject object;
  object.name = std::string(block.take(block.number(1 << (flags & 3))));
  object.header = kind == 0 ? block.number(8) : kHdf5Nowhere;  // a link to a name, perhaps in another file
  return object;
}

std::vector<NamedObject> objects_of(Hdf5Bytes& file, std::uint64_t group, const std::string* wanted) {
  const Hdf5Header header = read_hdf5_header(file, group);
  if (std::optional<Hdf5Block> table = header.find(Hdf5MessageKind::kSymbolTable)) {
    const std::uint64_t tree = table->number(8), heap = table->number(8);
    return NameTree(file, heap).objects(tree, wanted);
  }
  if (std::optional<Hdf5Block> info = header.find(Hdf5MessageKind::kLinkInfo)) {
    info->skip(1);
    info->skip((info->number(1) & 1) != 0 ? 8 : 0);
    if (info->number(8) != kHdf5Nowhere)
      info->fail(
          "the names are kept in a form of HDF5's newest version, which is not read; expected a file as h5py writes it "
          "without libver='latest' and track_order");
  }
  std::vector<NamedObject> objects;
  for (const Hdf5Message& message : header.messages)
    if (message.kind == Hdf5MessageKind::kLink) {
      NamedObject object = object_of_link(header, message);
      if (wanted == nullptr || object.name == *wanted) objects.push_back(std::move(object));
    }
  return objects;
}

}  // namespace

Hdf5File::Hdf5File(const std::string& path) : file_(path) {
  constexpr std::uint64_t kSmallest = 48;  // of the newest superblock
  if (file_.size() < kSmallest)
    throw InputError(fmt::format("'{}': expected an HDF5 file, found {} bytes", excerpt(path), file_.size()));
  Hdf5Block block = file_.block(0, kSmallest);
  if (block.take(kHdf5Signature.size()) != kHdf5Signature)
    throw InputError(fmt::format("'{}': byte 0: expected an HDF5 file, found other bytes", excerpt(path)));
  const std::uint64_t version = block.number(1);
  if (version > 3) block.fail(fmt::format("expected a superblock of version 0 to 3, found {}", version));
  if (version < 2) block.skip(4);
  const std::uint64_t offsets = block.number(1), lengths = block.number(1);
  if (offsets != 8 || lengths != 8)
    block.fail(fmt::format("expected addresses and lengths of 8 bytes, found {} and {}", offsets, lengths));
  // The rest of the superblock: some sizes of trees, then base, one other address, end; the root group's.
  const std::uint64_t at = version < 2 ? (version == 0 ? 24 : 28) : 12;
  Hdf5Block addresses = file_.block(at, version < 2 ? 48 : 32);
  if (addresses.number(8) != 0) addresses.fail("a file with bytes of others before its beginning is not read");
  addresses.skip(8);
  const std::uint64_t end = addresses.number(8);
  if (end > file_.size())
    throw InputError(fmt::format("'{}': truncated: expected {} bytes, found {}", excerpt(path), end, file_.size()));
  if (version < 2) addresses.skip(16);
  root_ = addresses.number(8);
}

std::vector<std::string> Hdf5File::names() {
  std::vector<std::string> names;
  for (NamedObject& object : objects_of(file_, root_, nullptr)) names.push_back(std::move(object.name));
  return names;
}

std::uint64_t Hdf5File::address_of(const std::string& name) {
  const std::vector<NamedObject> found = objects_of(file_, root_, &name);
  if (found.empty()) throw InputError(fmt::format("'{}': no array '{}'", excerpt(file_.path()), excerpt(name)));
  if (found.front().header == kHdf5Nowhere)
    throw InputError(fmt::format("'{}': '{}' is a link to another place, which is not followed", excerpt(file_.path()),
                                 excerpt(name)));
  return found.front().header;
}

std::vector<std::size_t> Hdf5File::shape(const std::string& name) {
  return hdf5_dataset(read_hdf5_header(file_, address_of(name))).shape;
}

NpyArray Hdf5File::array(const std::string& name) {
  return read_hdf5_array(file_, hdf5_dataset(read_hdf5_header(file_, address_of(name))));
}

namespace {

constexpr std::uint64_t kMostChunkBytes = std::uint64_t{256} << 20;
constexpr std::uint64_t kDeflatesAtMost = 1040;      // times: what zlib can make of zeros
constexpr std::size_t kMostTreeEntries = 2'000'000;  // of all nodes of a tree of chunks
constexpr int kMostRank = 8;

struct ElementType {
  std::size_t size = 4;
  bool big_endian = false;
};

enum class Hdf5Filter : std::uint16_t { kDeflate = 1, kShuffle = 2, kFletcher = 3 };

struct Hdf5Chunk {
  std::uint64_t begin = 0, size = 0, skipped_filters = 0;
  std::vector<std::uint64_t> offset;  // of its first number, a dimension each
};

struct ChunkLayout {
  std::uint64_t tree = 0;
  std::vector<std::uint64_t> shape;  // of a chunk
};

constexpr std::array<std::string_view, 11> kClasses = {"integers",     "floating point", "times",     "texts",
                                                       "bit fields",   "opaque bytes",   "compounds", "references",
                                                       "enumerations", "lists",          "arrays"};

ElementType element_type(const Hdf5Header& header) {
  std::optional<Hdf5Block> block = header.find(Hdf5MessageKind::kDatatype);
  if (!block) Hdf5Block(header.file, header.begin, {}).fail("expected a dataset with a type, found none");
  const std::size_t kind = block->number(1) & 15;
  const std::uint64_t bits = block->number(3), size = block->number(4);
  if (kind != 1 || (size != 4 && size != 8))
    block->fail(fmt::format("expected floating point of 4 or 8 bytes, found {} of {}",
                            kind < kClasses.size() ? kClasses[kind] : "an unknown type", size));
  const std::string_view wanted = size == 4 ? std::string_view("\0\0\x20\0\x17\x08\0\x17\x7f\0\0\0", 12)
                                            : std::string_view("\0\0\x40\0\x34\x0b\0\x34\xff\x03\0\0", 12);
  if ((bits & 0x40) != 0 || block->take(12) != wanted)
    block->fail("expected IEEE's floating point, found another form");
  return {.size = size, .big_endian = (bits & 1) != 0};
}

std::vector<std::uint16_t> filters_of(const Hdf5Header& header) {
  std::optional<Hdf5Block> block = header.find(Hdf5MessageKind::kFilters);
  if (!block) return {};
  const std::uint64_t version = block->number(1), count = block->number(1);
  if (version == 1) block->skip(6);
  std::vector<std::uint16_t> filters;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t id = block->number(2);
    const std::uint64_t name_size = version == 1 || id >= 256 ? block->number(2) : 0;
    block->skip(2);
    const std::uint64_t values = block->number(2);
    const std::string name(block->take(version == 1 ? (name_size + 7) / 8 * 8 : name_size));
    block->skip(4 * values + (version == 1 && values % 2 != 0 ? 4 : 0));
    if (id < 1 || id > 3)
      block->fail(fmt::format("expected numbers as they are or through gzip and shuffle, found filter {} ({})", id,
                              excerpt(name.c_str())));
    filters.push_back(static_cast<std::uint16_t>(id));
  }
  return filters;
}

// Byte k of every number after byte k - 1 of every number, back to numbers.
std::string unshuffled(const std::string& bytes, std::size_t size) {
  const std::size_t count = bytes.size() / size;
  std::string out = bytes;
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t k = 0; k < size; ++k) out[i * size + k] = bytes[k * count + i];
  return out;
}

std::string unfiltered(std::string bytes, const std::vector<std::uint16_t>& filters, const Hdf5Chunk& chunk,
                       std::size_t element, std::uint64_t expected, const Hdf5Block& where) {
  for (std::size_t i = filters.size(); i-- > 0;) {
    if ((chunk.skipped_filters >> i & 1) != 0) continue;
    const auto filter = static_cast<Hdf5Filter>(filters[i]);
    if (filter == Hdf5Filter::kFletcher) bytes.resize(bytes.size() - std::min<std::size_t>(bytes.size(), 4));
    if (filter == Hdf5Filter::kShuffle) bytes = unshuffled(bytes, element);
    if (filter == Hdf5Filter::kDeflate) {
      try {
        bytes = inflated(bytes, "chunk", expected + 4);
      } catch (const InputError& error) {
        where.fail(error.what());
      }
    }
  }
  if (bytes.size() != expected)
    where.fail(fmt::format("expected a chunk of {} bytes, found one of {}", expected, bytes.size()));
  return bytes;
}

double number_at(const char* bytes, const ElementType& type) {
  static_assert(std::endian::native == std::endian::little);
  char ordered[8] = {};
  std::copy_n(bytes, type.size, ordered);
  if (type.big_endian) std::reverse(ordered, ordered + type.size);
  if (type.size == 8) return std::bit_cast<double>(ordered);
  float value = 0.0F;
  std::memcpy(&value, ordered, sizeof value);
  return static_cast<double>(value);
}

class ChunkTree {
 public:
  ChunkTree(Hdf5Bytes& file, std::size_t rank) : file_(file), rank_(rank) {}

  std::vector<Hdf5Chunk> chunks(std::uint64_t root) {
    if (root != kHdf5Nowhere) visit(root, -1);
    return std::move(chunks_);
  }

 private:
  // `level` that the one above expects; -1: any.
  void visit(std::uint64_t begin, int level) {
    const std::uint64_t key_size = 8 + 8 * (rank_ + 1);
    Hdf5Block head = file_.block(begin, 24);
    head.expect("TREE");
    if (head.number(1) != 1) head.fail("expected a tree of chunks");
    const int found = static_cast<int>(head.number(1));
    const std::uint64_t count = head.number(2);
    entries_ += count + 1;
    if ((level >= 0 && found != level) || entries_ > kMostTreeEntries) head.fail("the tree of chunks is none");
    Hdf5Block block = file_.block(begin + 24, count * (key_size + 8));
    for (std::uint64_t i = 0; i < count; ++i) {
      Hdf5Chunk chunk;
      chunk.size = block.number(4);
      chunk.skipped_filters = block.number(4);
      for (std::size_t axis = 0; axis <= rank_; ++axis) chunk.offset.push_back(block.number(8));
      chunk.begin = block.number(8);
      if (found > 0)
        visit(chunk.begin, found - 1);
      else
        chunks_.push_back(std::move(chunk));
    }
  }

  Hdf5Bytes& file_;
  std::size_t rank_;
  std::size_t entries_ = 0;
  std::vector<Hdf5Chunk> chunks_;
};

// Chunks that lie on the grid, each once, and all of it: then what is allocated is what the file holds.
void check_chunks(const std::vector<Hdf5Chunk>& chunks, const std::vector<std::size_t>& shape,
                  const ChunkLayout& layout, std::uint64_t chunk_bytes, const Hdf5Block& where) {
  std::uint64_t expected = 1, stored = 0;
  for (std::size_t axis = 0; axis < shape.size(); ++axis)
    expected *= (shape[axis] + layout.shape[axis] - 1) / layout.shape[axis];
  if (chunks.size() != expected) where.fail(fmt::format("expected {} chunks, found {}", expected, chunks.size()));
  std::vector<std::vector<std::uint64_t>> offsets;
  for (const Hdf5Chunk& chunk : chunks) {
    for (std::size_t axis = 0; axis < shape.size(); ++axis)
      if (chunk.offset[axis] >= shape[axis] || chunk.offset[axis] % layout.shape[axis] != 0)
        where.fail("a chunk lies off the grid");
    offsets.push_back(chunk.offset);
    stored += chunk.size;
  }
  std::sort(offsets.begin(), offsets.end());
  if (std::adjacent_find(offsets.begin(), offsets.end()) != offsets.end()) where.fail("a chunk is there twice");
  if (expected * chunk_bytes / kDeflatesAtMost > stored)
    where.fail(fmt::format("{} bytes of chunks cannot hold {} bytes of numbers", stored, expected * chunk_bytes));
}

// The numbers of one chunk to their places; what of it lies outside of the array is left.
void place_chunk(const Hdf5Chunk& chunk, const std::string& bytes, const ElementType& type, const ChunkLayout& layout,
                 const std::vector<std::size_t>& shape, std::vector<double>& values) {
  const std::size_t rank = shape.size(), count = bytes.size() / type.size;
  std::vector<std::uint64_t> at(rank, 0);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t index = 0;
    bool inside = true;
    for (std::size_t axis = 0; axis < rank; ++axis) {
      const std::uint64_t place = chunk.offset[axis] + at[axis];
      inside = inside && place < shape[axis];
      index = index * shape[axis] + place;
    }
    if (inside) values[index] = number_at(&bytes[i * type.size], type);
    for (std::size_t axis = rank; axis-- > 0 && ++at[axis] == layout.shape[axis];) at[axis] = 0;
  }
}

std::vector<double> read_chunks(Hdf5Bytes& file, const Hdf5Dataset& dataset, const ChunkLayout& layout,
                                const ElementType& type, std::size_t count, const Hdf5Block& where) {
  std::uint64_t chunk_bytes = type.size;
  for (const std::uint64_t size : layout.shape) {
    if (size == 0 || size > kMostChunkBytes || chunk_bytes * size > kMostChunkBytes)
      where.fail(fmt::format("expected chunks of at most {} bytes", kMostChunkBytes));
    chunk_bytes *= size;
  }
  const std::vector<std::uint16_t> filters = filters_of(dataset.header);
  const std::vector<Hdf5Chunk> chunks = ChunkTree(file, dataset.shape.size()).chunks(layout.tree);
  check_chunks(chunks, dataset.shape, layout, chunk_bytes, where);
  std::vector<double> values(count);
  for (const Hdf5Chunk& chunk : chunks) {
    Hdf5Block stored = file.block(chunk.begin, chunk.size);
    const std::string bytes(stored.take(chunk.size));
    place_chunk(chunk, unfiltered(bytes, filters, chunk, type.size, chunk_bytes, stored), type, layout, dataset.shape,
                values);
  }
  return values;
}

std::vector<double> in_one_piece(std::string_view bytes, const ElementType& type, std::size_t count) {
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = number_at(bytes.data() + i * type.size, type);
  return values;
}

ChunkLayout chunk_layout(Hdf5Block& block, std::size_t rank) {
  if (const std::uint64_t found = block.number(1); found != rank + 1)
    block.fail(fmt::format("expected chunks of {} dimensions, found {}", rank, found - 1));
  ChunkLayout layout{.tree = block.number(8), .shape = {}};
  for (std::size_t axis = 0; axis < rank; ++axis) layout.shape.push_back(block.number(4));
  return layout;
}

}  // namespace

Hdf5Dataset hdf5_dataset(Hdf5Header header) {
  std::optional<Hdf5Block> space = header.find(Hdf5MessageKind::kDataspace);
  if (!space) Hdf5Block(header.file, header.begin, {}).fail("expected a dataset, found a group or another object");
  const std::uint64_t version = space->number(1), rank = space->number(1);
  if ((version != 1 && version != 2) || rank > kMostRank)
    space->fail(fmt::format("expected a shape of at most {} dimensions, found version {} and {} dimensions", kMostRank,
                            version, rank));
  space->skip(version == 1 ? 6 : 2);
  Hdf5Dataset dataset{.shape = {}, .header = std::move(header)};
  for (std::uint64_t axis = 0; axis < rank; ++axis) dataset.shape.push_back(space->number(8));
  return dataset;
}

NpyArray read_hdf5_array(Hdf5Bytes& file, const Hdf5Dataset& dataset) {
  const Hdf5Header& header = dataset.header;
  const ElementType type = element_type(header);
  std::optional<Hdf5Block> block = header.find(Hdf5MessageKind::kLayout);
  if (!block || header.has(Hdf5MessageKind::kExternalFiles))
    Hdf5Block(header.file, header.begin, {}).fail("expected the numbers in this file");
  std::size_t count = 0;
  try {
    count = checked_count(dataset.shape, kMaxArrayValues);
  } catch (const InputError& error) {
    block->fail(error.what());
  }
  const std::uint64_t version = block->number(1), kind = block->number(1);
  if ((version != 3 && version != 4) || kind > 2 || (version == 4 && kind == 2))
    block->fail(fmt::format("expected a layout as HDF5 1.8 writes it, found version {}, kind {}", version, kind));
  NpyArray array{.shape = dataset.shape, .values = std::vector<double>()};
  if (kind == 2) {
    const ChunkLayout layout = chunk_layout(*block, dataset.shape.size());
    array.values = read_chunks(file, dataset, layout, type, count, *block);
    return array;
  }
  const std::uint64_t begin = kind == 0 ? 0 : block->number(8), size = block->number(kind == 0 ? 2 : 8);
  if (size != count * type.size || begin == kHdf5Nowhere)
    block->fail(
        fmt::format("expected {} bytes of numbers, found {}", count * type.size, begin == kHdf5Nowhere ? 0 : size));
  if (kind == 0) {
    array.values = in_one_piece(block->take(size), type, count);
  } else {
    Hdf5Block stored = file.block(begin, size);
    array.values = in_one_piece(stored.take(size), type, count);
  }
  return array;
}

}  // namespace duet
