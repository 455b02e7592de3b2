#include "duet/people/hdf5/hdf5_block.h"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "duet/core/data_file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {

Hdf5Block::Hdf5Block(const std::string& file, std::uint64_t begin, std::string bytes)
    : file_(file), begin_(begin), bytes_(std::move(bytes)) {}

void Hdf5Block::fail(const std::string& fault) const {
  throw InputError(fmt::format("'{}': byte {}: {}", shown(file_), position(), fault));
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
  if (!file_ || !plain) throw InputError(fmt::format("cannot read '{}': no such file", shown(path)));
  require_data(path);
  size_ = std::filesystem::file_size(path, error);
  if (error) throw InputError(fmt::format("cannot read '{}': {}", shown(path), error.message()));
}

Hdf5Block Hdf5Bytes::block(std::uint64_t begin, std::uint64_t size) {
  if (begin > size_ || size > size_ - begin)
    throw InputError(
        fmt::format("'{}': byte {}: expected {} bytes, the file ends at {}", shown(path_), begin, size, size_));
  std::string bytes(size, '\0');
  file_.clear();
  file_.seekg(static_cast<std::streamoff>(begin));
  file_.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uint64_t>(file_.gcount()) != size)
    throw InputError(
        fmt::format("'{}': byte {}: expected {} bytes, read {}", shown(path_), begin, size, file_.gcount()));
  return {path_, begin, std::move(bytes)};
}

}  // namespace duet
