// The header of an object in an HDF5 file: its messages, each a number for its kind and some bytes. Both versions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "duet/people/hdf5/hdf5_block.h"

namespace duet {

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
