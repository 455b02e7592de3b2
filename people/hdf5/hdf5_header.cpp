#include "duet/people/hdf5/hdf5_header.h"

#include <fmt/format.h>

#include <deque>
#include <filesystem>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::uint64_t kMostHeaderBytes = std::uint64_t{64} << 20;
constexpr std::size_t kMostContinuations = 10'000;
constexpr int kSharedFlag = 0x02;

struct HeaderPart {
  std::uint64_t begin = 0, size = 0;
};

struct HeaderForm {
  int version = 1;
  bool creation_order = false;  // version 2: each message has two bytes of it
};

// Begins where the first message does; fills `first` with the part of the file that holds the first messages.
HeaderForm read_prefix(Hdf5Bytes& file, std::uint64_t begin, HeaderPart& first) {
  constexpr std::uint64_t kPrefixBytes = 16;  // of version 1; the smallest of version 2 has 4 bytes of checksum behind
  Hdf5Block block = file.block(begin, kPrefixBytes);
  if (block.take(4) != "OHDR") {
    Hdf5Block old = file.block(begin, kPrefixBytes);
    if (const std::uint64_t version = old.number(1); version != 1)
      old.fail(fmt::format("expected the header of an object (version 1 or 'OHDR'), found {}", version));
    old.skip(7);
    first = {begin + kPrefixBytes, old.number(4)};
    return {};
  }
  if (const std::uint64_t version = block.number(1); version != 2)
    block.fail(fmt::format("expected a header of version 2, found {}", version));
  const std::uint64_t flags = block.number(1);
  const std::uint64_t times = (flags & 0x20) != 0 ? 16 : 0, counts = (flags & 0x10) != 0 ? 4 : 0;
  const int width = 1 << (flags & 3);
  const std::uint64_t at = begin + 6 + times + counts;
  first.begin = at + static_cast<std::uint64_t>(width);
  first.size = file.block(at, static_cast<std::uint64_t>(width)).number(width);
  return {.version = 2, .creation_order = (flags & 0x04) != 0};
}

Hdf5Message take_message(Hdf5Block& block, const HeaderForm& form) {
  Hdf5Message message;
  message.kind = static_cast<Hdf5MessageKind>(block.number(form.version == 1 ? 2 : 1));
  const std::uint64_t size = block.number(2);
  message.shared = (block.number(1) & kSharedFlag) != 0;
  block.skip(form.version == 1 ? 3 : (form.creation_order ? 2 : 0));
  message.begin = block.position();
  message.bytes = std::string(block.take(size));
  return message;
}

}  // namespace

bool Hdf5Header::has(Hdf5MessageKind kind) const {
  for (const Hdf5Message& message : messages)
    if (message.kind == kind) return true;
  return false;
}

std::optional<Hdf5Block> Hdf5Header::find(Hdf5MessageKind kind) const {
  for (const Hdf5Message& message : messages) {
    if (message.kind != kind) continue;
    Hdf5Block block(file, message.begin, message.bytes);
    if (message.shared) block.fail("what several objects share (a named type) is not read");
    return block;
  }
  return std::nullopt;
}

Hdf5Header read_hdf5_header(Hdf5Bytes& file, std::uint64_t begin) {
  Hdf5Header header{.file = file.path(), .begin = begin};
  std::deque<HeaderPart> parts(1);
  const HeaderForm form = read_prefix(file, begin, parts.front());
  const std::size_t least = form.version == 1 ? 8 : (form.creation_order ? 6 : 4);
  std::uint64_t total = 0;
  for (std::size_t count = 0; !parts.empty(); ++count, parts.pop_front()) {
    const HeaderPart part = parts.front();
    total += part.size;
    Hdf5Block block = file.block(part.begin, part.size > kMostHeaderBytes ? kMostHeaderBytes : part.size);
    if (total > kMostHeaderBytes || count > kMostContinuations)
      block.fail("the header of an object goes on without end");
    if (form.version == 2 && count > 0) block.expect("OCHK");
    const std::size_t checksum = form.version == 2 && count > 0 ? 4 : 0;
    while (block.left() >= least + checksum) {
      Hdf5Message message = take_message(block, form);
      if (message.kind == Hdf5MessageKind::kContinuation) {
        Hdf5Block where(file.path(), message.begin, message.bytes);
        const std::uint64_t at = where.number(8);
        parts.push_back({.begin = at, .size = where.number(8)});
      } else {
        header.messages.push_back(std::move(message));
      }
    }
  }
  return header;
}

Hdf5Block::Hdf5Block(const std::string& file, std::uint64_t begin, std::string bytes)
    : file_(file), begin_(begin), bytes_(std::move(bytes)) {}

void Hdf5Block::fail(const std::string& fault) const {
  throw InputError(fmt::format("'{}': byte {}: {}", excerpt(file_), position(), fault));
}

std::string_view Hdf5Block::take(std::uint64_t size) {
  if (size > left()) fail(fmt::format("expected {} more bytes of this part, found {}", size, left()));
  const std::string_view part = std::string_view(bytes_).substr(at_, size);
  at_ += size;
  return part;
}

std::uint64_t Hdf5Block::number(int size) {
  std::uint64_t value = 0;
  const std::string_view part = take(static_cast<std::uint64_t>(size));
  for (int i = size - 1; i >= 0; --i)
    value = value << 8 | static_cast<unsigned char>(part[static_cast<std::size_t>(i)]);
  return value;
}

void Hdf5Block::expect(std::string_view signature) {
  if (left() < signature.size() || std::string_view(bytes_).substr(at_, signature.size()) != signature)
    fail(fmt::format("expected '{}'", signature));
  at_ += signature.size();
}

Hdf5Bytes::Hdf5Bytes(const std::string& path) : path_(path), file_(path, std::ios::binary) {
  std::error_code error;
  const bool plain = std::filesystem::is_regular_file(path, error);
  if (!file_ || !plain) throw InputError(fmt::format("cannot read '{}': no such file", excerpt(path)));
  require_data(path);
  size_ = std::filesystem::file_size(path, error);
  if (error) throw InputError(fmt::format("cannot read '{}': {}", excerpt(path), error.message()));
}

Hdf5Block Hdf5Bytes::block(std::uint64_t begin, std::uint64_t size) {
  if (begin > size_ || size > size_ - begin)
    throw InputError(
        fmt::format("'{}': byte {}: expected {} bytes, the file ends at {}", excerpt(path_), begin, size, size_));
  std::string bytes(size, '\0');
  file_.clear();
  file_.seekg(static_cast<std::streamoff>(begin));
  file_.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uint64_t>(file_.gcount()) != size)
    throw InputError(
        fmt::format("'{}': byte {}: expected {} bytes, read {}", excerpt(path_), begin, size, file_.gcount()));
  return {path_, begin, std::move(bytes)};
}

}  // namespace duet
