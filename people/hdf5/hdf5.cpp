#include "duet/people/hdf5/hdf5.h"

#include <fmt/format.h>

#include <utility>

#include "duet/core/require.h"
#include "duet/core/text.h"

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
    throw InputError(fmt::format("'{}': expected an HDF5 file, found {} bytes", shown(path), file_.size()));
  Hdf5Block block = file_.block(0, kSmallest);
  if (block.take(kHdf5Signature.size()) != kHdf5Signature)
    throw InputError(fmt::format("'{}': byte 0: expected an HDF5 file, found other bytes", shown(path)));
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
    throw InputError(fmt::format("'{}': truncated: expected {} bytes, found {}", shown(path), end, file_.size()));
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
  if (found.empty()) throw InputError(fmt::format("'{}': no array '{}'", shown(file_.path()), shown(name)));
  if (found.front().header == kHdf5Nowhere)
    throw InputError(
        fmt::format("'{}': '{}' is a link to another place, which is not followed", shown(file_.path()), shown(name)));
  return found.front().header;
}

std::vector<std::size_t> Hdf5File::shape(const std::string& name) {
  return hdf5_dataset(read_hdf5_header(file_, address_of(name))).shape;
}

NpyArray Hdf5File::array(const std::string& name) {
  return read_hdf5_array(file_, hdf5_dataset(read_hdf5_header(file_, address_of(name))));
}

}  // namespace duet
