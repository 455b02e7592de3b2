// Shared by the readers' fuzz targets. A reader may refuse its input with InputError and nothing else: any other
// exception ends the run as a finding. Samples are made in code, so that no seed files are needed.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "core/require.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace duet::fuzz {

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

template <typename Read>
int read_or_refuse(Read&& read) {
  try {
    read();
  } catch (const InputError&) {
    return 0;
  }
  return 0;
}

// libFuzzer's own mutation, which now and then begins anew from `sample`.
inline std::size_t mutate(std::uint8_t* data, std::size_t size, std::size_t max_size, unsigned seed,
                          const std::string& sample) {
  if (size < 2 || seed % 64 == 0) {
    size = std::min(sample.size(), max_size);
    std::memcpy(data, sample.data(), size);
  }
  return LLVMFuzzerMutate(data, size, max_size);
}

}  // namespace duet::fuzz
