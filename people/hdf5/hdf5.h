// HDF5 files of named arrays, as h5py and HDF5's own tools write them unless asked for the newest form: the arrays of
// the root group, single and double precision. A reader of our own: HDF5's library, which Debian packages, does not
// survive damaged files (11 of 5,000 with a few changed bytes end the program, 3 run on without end). Nothing but the
// array that is asked for is in memory. Not thread-safe: one owner.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/npy/npy.h"
#include "duet/people/hdf5/hdf5_header.h"

namespace duet {

// The numbers of a dataset in an HDF5 file: single and double precision, in one piece or in chunks, as they are or
// through deflate, shuffle and Fletcher's checksum (which is not compared).

// The header of a dataset, parsed; `header` is left whole, so that a refusal can name its byte.
struct Hdf5Dataset {
  std::vector<std::size_t> shape;
  Hdf5Header header;
};

// Throws InputError naming file and byte: not a dataset (a group), no shape.
Hdf5Dataset hdf5_dataset(Hdf5Header header);

// In C order. Throws InputError naming file and byte: another type than IEEE's f4 and f8, a filter that is not known, a
// chunk that is missing, more numbers than the file has bytes for or than an array may have (npy.h).
NpyArray read_hdf5_array(Hdf5Bytes& file, const Hdf5Dataset& dataset);

inline constexpr std::string_view kHdf5Signature = "\x89HDF\r\n\x1a\n";

class Hdf5File {
 public:
  // Throws InputError naming file, byte, expected and found: not HDF5, truncated, addresses of another size than 8.
  explicit Hdf5File(const std::string& path);

  // The names in the root group, in the file's order, which is that of the names. Throws InputError: damage, a group in
  // the form that only the newest HDF5 writes, more than some 3,000,000 names.
  [[nodiscard]] std::vector<std::string> names();

  // Throws InputError: no such name, not an array, what read_hdf5_array says.
  [[nodiscard]] std::vector<std::size_t> shape(const std::string& name);
  [[nodiscard]] NpyArray array(const std::string& name);

 private:
  [[nodiscard]] std::uint64_t address_of(const std::string& name);

  Hdf5Bytes file_;
  std::uint64_t root_ = 0;
};

}  // namespace duet
