// Archives with one thing changed, for tests of the readers' refusals.
#pragma once

#include <string>

#include "duet/archives/npy/npz.h"

namespace duet::test {

// The archive without one key.
inline std::string without_key(const std::string& bytes, const std::string& key) {
  const Npz whole = Npz::parse(bytes, "whole");
  Npz part;
  for (const std::string& name : whole.keys())
    if (name != key) part.set(name, whole.array(name));
  return part.bytes();
}

// The archive after `edit(npz)`.
template <typename Edit>
std::string edited(const std::string& bytes, Edit&& edit) {
  Npz npz = Npz::parse(bytes, "whole");
  edit(npz);
  return npz.bytes();
}

// The archive with one number of a floating-point array replaced.
inline std::string with_number(const std::string& bytes, const std::string& key, std::size_t index, double value) {
  return edited(bytes, [&](Npz& npz) {
    NpyArray array = npz.array(key);
    std::get<std::vector<double>>(array.values)[index] = value;
    npz.set(key, std::move(array));
  });
}

}  // namespace duet::test
