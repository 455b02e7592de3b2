#include "duet/archives/npy/npz.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "duet/archives/npy/npy.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::string_view kSuffix = ".npy";
constexpr std::size_t kShownKeys = 400;  // of all names together
constexpr std::size_t kMaxArchiveBytes = std::size_t{1} << 30;
constexpr ZipLimits kLimits{.entry_bytes = kMaxEntryBytes, .total_bytes = kMaxArchiveBytes};

const char* type_name(const NpyArray& array) {
  constexpr const char* kNames[] = {"numbers", "integers", "strings"};
  return kNames[array.values.index()];
}

std::string expected_shape_text(const std::vector<long>& shape) {
  std::vector<std::string> sizes;
  sizes.reserve(shape.size());
  for (const long size : shape) sizes.push_back(size < 0 ? "any" : fmt::format("{}", size));
  return fmt::format("({}{})", fmt::join(sizes, ", "), shape.size() == 1 ? "," : "");
}

bool fits(const std::vector<std::size_t>& found, const std::vector<long>& expected) {
  if (found.size() != expected.size()) return false;
  for (std::size_t d = 0; d < found.size(); ++d)
    if (expected[d] >= 0 && found[d] != static_cast<std::size_t>(expected[d])) return false;
  return true;
}

std::vector<std::size_t> index_of(std::size_t flat, const std::vector<std::size_t>& shape) {
  std::vector<std::size_t> index(shape.size());
  for (std::size_t d = shape.size(); d-- > 0; flat /= shape[d]) index[d] = flat % shape[d];
  return index;
}

// The memory that the values take.
std::size_t bytes_of(const NpyArray& array) {
  return std::visit(
      [](const auto& values) {
        std::size_t bytes = values.size() * sizeof(values[0]);
        if constexpr (std::is_same_v<std::decay_t<decltype(values[0])>, std::string>)
          for (const std::string& value : values) bytes += value.size();
        return bytes;
      },
      array.values);
}

[[noreturn]] void refuse(const Npz& npz, const std::string& key, const std::string& problem) {
  throw InputError(fmt::format("'{}': array '{}': {}", npz.name(), excerpt(key), problem));
}

const NpyArray& shaped_array(const Npz& npz, const std::string& key, const std::vector<long>& shape) {
  const NpyArray& array = npz.array(key);
  if (!fits(array.shape, shape))
    refuse(npz, key, fmt::format("expected shape {}, found {}", expected_shape_text(shape), shape_text(array.shape)));
  return array;
}

// The values where they are of type T.
template <typename T>
const std::vector<T>& typed(const Npz& npz, const std::string& key, const NpyArray& array, const char* expected) {
  const auto* values = std::get_if<std::vector<T>>(&array.values);
  if (values == nullptr) refuse(npz, key, fmt::format("expected {}, found {}", expected, type_name(array)));
  return *values;
}

// Looks at the type in the header, which is a dictionary of three keys at the start of the entry.
bool holds_objects(std::string_view entry) {
  constexpr std::size_t kHeader = 256;
  return entry.substr(0, kHeader).find("'descr': '|O'") != std::string_view::npos;
}

// A scalar is stored as shape () or, by some writers, as (1,) or (1, 1).
std::vector<long> scalar_shape(const Npz& npz, const std::string& key) {
  const std::vector<std::size_t>& shape = npz.array(key).shape;
  const bool ones = std::all_of(shape.begin(), shape.end(), [](std::size_t size) { return size == 1; });
  return ones ? std::vector<long>(shape.size(), 1) : std::vector<long>{};
}

}  // namespace

Npz Npz::load(const std::string& path) { return parse(read_data(path), path); }

Npz Npz::load(const std::string& path, const std::vector<std::string>& only) {
  return parse(read_data(path), path, only);
}

void Npz::take(const std::string& entry, const std::string& content, std::size_t& held) {
  if (!entry.ends_with(kSuffix) || entry.size() == kSuffix.size())
    throw InputError(fmt::format("'{}': expected entries named '<key>.npy', found '{}'", name_, excerpt(entry)));
  const std::string key = entry.substr(0, entry.size() - kSuffix.size());
  try {
    const auto [added, is_new] = arrays_.emplace(key, parse_npy(content));
    if (!is_new) throw InputError("stands in the archive twice");
    held += bytes_of(added->second);
  } catch (const InputError& error) {
    refuse(*this, key, error.what());
  }
  // One byte in the file may become eight in memory, and a string of no characters 32.
  if (held > kMaxArchiveBytes)
    throw InputError(
        fmt::format("'{}': expected arrays of at most {} bytes together, found more", name_, kMaxArchiveBytes));
}

Npz Npz::parse(std::string_view bytes, const std::string& name, ObjectArrays objects) {
  Npz npz;
  npz.name_ = name;
  std::size_t held = 0;
  read_zip(bytes, name, kLimits, [&](const std::string& entry, const std::string& content) {
    if (objects == ObjectArrays::kRefused || !holds_objects(content)) npz.take(entry, content, held);
  });
  return npz;
}

Npz Npz::parse(std::string_view bytes, const std::string& name, const std::vector<std::string>& only) {
  Npz npz;
  npz.name_ = name;
  std::size_t held = 0;
  const auto wanted = [&](const std::string& entry) {
    const std::string key = entry.substr(0, entry.size() - std::min(entry.size(), kSuffix.size()));
    const bool is_wanted = entry.ends_with(kSuffix) && std::find(only.begin(), only.end(), key) != only.end();
    if (!is_wanted) npz.left_out_.push_back(key);
    return is_wanted;
  };
  read_zip(bytes, name, kLimits, wanted,
           [&](const std::string& entry, const std::string& content) { npz.take(entry, content, held); });
  return npz;
}

void Npz::save(const std::string& path) const { write_file(path, bytes()); }

std::string Npz::bytes(ZipMethod method) const {
  std::vector<ZipEntry> entries;
  for (const auto& [key, array] : arrays_) {
    try {
      entries.push_back({key + std::string(kSuffix), npy_bytes(array)});
    } catch (const InputError& error) {
      refuse(*this, key, error.what());
    }
  }
  return zip_bytes(entries, method);
}

std::vector<std::string> Npz::keys() const {
  std::vector<std::string> keys;
  keys.reserve(arrays_.size());
  for (const auto& [key, array] : arrays_) keys.push_back(key);
  return keys;
}

const NpyArray& Npz::array(const std::string& key) const {
  const auto found = arrays_.find(key);
  if (found != arrays_.end()) return found->second;
  std::vector<std::string> names = keys();
  names.insert(names.end(), left_out_.begin(), left_out_.end());
  throw InputError(fmt::format("'{}': no array '{}'. It has: {}", name_, key,
                               excerpt(fmt::format("{}", fmt::join(names, ", ")), kShownKeys)));
}

std::vector<double> Npz::numbers(const std::string& key, const std::vector<long>& shape) const {
  const NpyArray& array = shaped_array(*this, key, shape);
  if (const auto* integers = std::get_if<std::vector<std::int64_t>>(&array.values))
    return {integers->begin(), integers->end()};
  const std::vector<double>& values = typed<double>(*this, key, array, "numbers");
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i]))
      refuse(*this, key,
             fmt::format("expected finite numbers, found {} at index {}", values[i],
                         shape_text(index_of(i, array.shape))));
  return values;
}

std::vector<std::int64_t> Npz::integers(const std::string& key, const std::vector<long>& shape) const {
  return typed<std::int64_t>(*this, key, shaped_array(*this, key, shape), "integers");
}

std::vector<std::string> Npz::strings(const std::string& key, const std::vector<long>& shape) const {
  return typed<std::string>(*this, key, shaped_array(*this, key, shape), "strings");
}

double Npz::number(const std::string& key) const { return numbers(key, scalar_shape(*this, key)).front(); }

double Npz::number_or_text(const std::string& key) const {
  if (!std::holds_alternative<std::vector<std::string>>(array(key).values)) return number(key);
  const std::string words = text(key);
  if (const std::optional<double> value = parse_number(words)) return *value;
  refuse(*this, key, fmt::format("expected a number, found '{}'", excerpt(words)));
}

std::int64_t Npz::integer(const std::string& key) const { return integers(key, scalar_shape(*this, key)).front(); }

std::string Npz::text(const std::string& key) const { return strings(key, scalar_shape(*this, key)).front(); }

PointTracks Npz::tracks(const std::string& key, int points) const {
  std::vector<double> values = numbers(key, {-1, points, 3});
  const std::vector<std::size_t>& shape = array(key).shape;  // no size is above 2^27 (kMaxArrayValues)
  return {static_cast<int>(shape[0]), static_cast<int>(shape[1]), std::move(values)};
}

void Npz::set(const std::string& key, NpyArray array) {
  require(!key.empty(), "an array of an archive needs a name");
  const std::size_t found = std::visit([](const auto& values) { return values.size(); }, array.values);
  std::size_t expected = 1;
  for (const std::size_t size : array.shape) expected *= size;
  require(found == expected, "array '{}': shape {} needs {} values, found {}", key, shape_text(array.shape), expected,
          found);
  if (const auto* strings = std::get_if<std::vector<std::string>>(&array.values))
    for (const std::string& value : *strings) decode_utf8(value);  // refused here rather than at the write
  arrays_.insert_or_assign(key, std::move(array));
}

void Npz::set(const std::string& key, std::vector<double> values, std::vector<std::size_t> shape) {
  set(key, NpyArray{std::move(shape), std::move(values)});
}

void Npz::set(const std::string& key, std::vector<std::int64_t> values, std::vector<std::size_t> shape) {
  set(key, NpyArray{std::move(shape), std::move(values)});
}

void Npz::set(const std::string& key, std::vector<std::string> values) {
  const std::size_t size = values.size();
  set(key, NpyArray{{size}, std::move(values)});
}

void Npz::set_number(const std::string& key, double value) { set(key, NpyArray{{}, std::vector<double>{value}}); }

void Npz::set_integer(const std::string& key, std::int64_t value) {
  set(key, NpyArray{{}, std::vector<std::int64_t>{value}});
}

void Npz::set_text(const std::string& key, const std::string& value) {
  set(key, NpyArray{{}, std::vector<std::string>{value}});
}

void Npz::set(const std::string& key, const PointTracks& tracks) {
  set(key, tracks.data(), {static_cast<std::size_t>(tracks.frames()), static_cast<std::size_t>(tracks.points()), 3});
}

}  // namespace duet
