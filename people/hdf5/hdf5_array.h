// The numbers of a dataset in an HDF5 file: single and double precision, in one piece or in chunks, as they are or
// through deflate, shuffle and Fletcher's checksum (which is not compared).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "duet/archives/npy/npy_array.h"
#include "duet/people/hdf5/hdf5_header.h"

namespace duet {

// The header of a dataset, parsed; `header` is left whole, so that a refusal can name its byte.
struct Hdf5Dataset {
  std::vector<std::size_t> shape;
  Hdf5Header header;
};

// Throws InputError naming file and byte: not a dataset (a group), no shape.
Hdf5Dataset hdf5_dataset(Hdf5Header header);

// In C order. Throws InputError naming file and byte: another type than IEEE's f4 and f8, a filter that is not known, a
// chunk that is missing, more numbers than the file has bytes for or than an array may have (npy_array.h).
NpyArray read_hdf5_array(Hdf5Bytes& file, const Hdf5Dataset& dataset);

}  // namespace duet
