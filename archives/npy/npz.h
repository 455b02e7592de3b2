// NPY arrays and NPZ archives (NumPy's formats, version 1.0; zip through libzip, deflated or stored). `numpy.load`
// opens what is written here. The same arrays give the same bytes on every run (fixed time stamps, sorted names).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/npy/npy.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/recording.h"

namespace duet {

// The treatment of arrays of Python objects: they refuse the archive, or are left out as if they were not in it (files
// that keep `None` in one of their arrays). They are never read.
enum class ObjectArrays { kRefused, kSkipped };

class Npz {
 public:
  // Throws InputError naming `path`, the entry and what is wrong: not a zip, truncated, an object array (never
  // executed), an unknown type, a size that does not match the shape, more than 1 GiB in one entry or in all arrays
  // together (two people and a robot at 120 Hz for an hour take half of it).
  static Npz load(const std::string& path);
  // `name` stands in messages.
  static Npz parse(std::string_view bytes, const std::string& name, ObjectArrays objects = ObjectArrays::kRefused);
  // Only the arrays of these names (those that are there); the others are neither inflated nor judged, so that they may
  // be of any type.
  static Npz load(const std::string& path, const std::vector<std::string>& only);
  static Npz parse(std::string_view bytes, const std::string& name, const std::vector<std::string>& only);
  // Atomic (core/file.h). Throws InputError.
  void save(const std::string& path) const;
  [[nodiscard]] std::string bytes(ZipMethod method = ZipMethod::kDeflated) const;

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool contains(const std::string& key) const { return arrays_.contains(key); }
  [[nodiscard]] std::vector<std::string> keys() const;

  // Each getter throws InputError naming the archive, the key, the expected and the found shape or type, the missing
  // key (with the keys that are there), or the first index that is not finite. -1 in `shape` accepts any size.
  [[nodiscard]] const NpyArray& array(const std::string& key) const;
  [[nodiscard]] std::vector<double> numbers(const std::string& key, const std::vector<long>& shape) const;
  [[nodiscard]] std::vector<std::int64_t> integers(const std::string& key, const std::vector<long>& shape) const;
  [[nodiscard]] std::vector<std::string> strings(const std::string& key, const std::vector<long>& shape) const;
  [[nodiscard]] double number(const std::string& key) const;
  // The same where files of others may have it as text ("30").
  [[nodiscard]] double number_or_text(const std::string& key) const;
  [[nodiscard]] std::int64_t integer(const std::string& key) const;
  [[nodiscard]] std::string text(const std::string& key) const;
  [[nodiscard]] PointTracks tracks(const std::string& key, int points) const;  // (T, points, 3); points = -1: any

  void set(const std::string& key, NpyArray array);  // throws std::invalid_argument where size and shape disagree
  void set(const std::string& key, std::vector<double> values, std::vector<std::size_t> shape);
  void set(const std::string& key, std::vector<std::int64_t> values, std::vector<std::size_t> shape);
  void set(const std::string& key, std::vector<std::string> values);  // 1-D
  void set_number(const std::string& key, double value);
  void set_integer(const std::string& key, std::int64_t value);
  void set_text(const std::string& key, const std::string& value);
  void set(const std::string& key, const PointTracks& tracks);

 private:
  void take(const std::string& entry, const std::string& content, std::size_t& held);

  std::string name_ = "(new archive)";
  std::vector<std::string> left_out_;  // keys that are in the file and were not asked for
  std::map<std::string, NpyArray> arrays_;
};

}  // namespace duet
