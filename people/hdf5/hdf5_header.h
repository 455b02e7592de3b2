// The header of an object in an HDF5 file: its messages, each a number for its kind and some bytes. Both versions.
#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// Bytes of an HDF5 file, a part at a time, taken from front to back. A request beyond the file or beyond the part
// throws InputError naming file and byte; nothing is allocated by a length that the file claims. Not thread-safe.

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

inline constexpr std::uint64_t kHdf5Nowhere = ~std::uint64_t{0};  // an address that is none

enum class Hdf5MessageKind : std::uint16_t {
  kDataspace = 0x01,
  kLinkInfo = 0x02,
  kDatatype = 0x03,
  kLink = 0x06,
  kExternalFiles = 0x07,
  kLayout = 0x08,
  kFilters = 0x0b,
  kContinuation = 0x10,
  kSymbolTable = 0x11,
};

struct Hdf5Message {
  Hdf5MessageKind kind{};
  bool shared = false;  // its bytes say where the message is
  std::uint64_t begin = 0;
  std::string bytes;
};

struct Hdf5Header {
  std::string file;
  std::uint64_t begin = 0;
  std::vector<Hdf5Message> messages = {};

  [[nodiscard]] bool has(Hdf5MessageKind kind) const;
  // The first of a kind; nothing where there is none. Throws InputError where it is shared.
  [[nodiscard]] std::optional<Hdf5Block> find(Hdf5MessageKind kind) const;
};

// Throws InputError naming file and byte: no header there, a message that ends beyond its part, continuations without
// end, more than 64 MiB.
Hdf5Header read_hdf5_header(Hdf5Bytes& file, std::uint64_t begin);

}  // namespace duet
