// Bytes of an HDF5 file, a part at a time, taken from front to back. A request beyond the file or beyond the part
// throws InputError naming file and byte; nothing is allocated by a length that the file claims. Not thread-safe.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>

namespace duet {

class Hdf5Block {
 public:
  // `begin`: where in the file it stands.
  Hdf5Block(const std::string& file, std::uint64_t begin, std::string bytes);

  [[nodiscard]] std::uint64_t position() const { return begin_ + at_; }  // in the file [bytes]
  [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }

  std::string_view take(std::uint64_t size);
  void skip(std::uint64_t size) { (void)take(size); }
  // Little-endian, of at most 8 bytes.
  std::uint64_t number(int size);
  void expect(std::string_view signature);

  // Throws InputError: "'FILE': byte N: `fault`".
  [[noreturn]] void fail(const std::string& fault) const;

 private:
  std::string file_;
  std::uint64_t begin_ = 0;
  std::size_t at_ = 0;
  std::string bytes_;
};

class Hdf5Bytes {
 public:
  explicit Hdf5Bytes(const std::string& path);  // throws InputError naming it

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }

  Hdf5Block block(std::uint64_t begin, std::uint64_t size);

 private:
  std::string path_;
  std::ifstream file_;
  std::uint64_t size_ = 0;
};

}  // namespace duet
