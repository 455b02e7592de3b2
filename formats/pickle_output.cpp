#include "duet/formats/pickle_output.h"

#include <bit>
#include <limits>

#include "duet/core/require.h"
#include "duet/formats/file_arrays.h"

namespace duet {
namespace {

// Opcodes of protocol 4 (PEP 307, PEP 3154; Python's Lib/pickletools.py).
constexpr std::string_view kProtocol = "\x80\x04", kStop = ".", kEmptyDict = "}", kEmptyList = "]", kMark = "(",
                           kSetItems = "u", kAppends = "e", kTuple = "t", kReduce = "R", kBuild = "b", kNone = "N",
                           kTrue = "\x88", kFalse = "\x89", kTuple1 = "\x85", kTuple3 = "\x87", kGlobal = "\x93",
                           kText = "X", kBytes = "B", kBytes8 = "\x8e", kFloat = "G", kInt = "J", kLong = "\x8a\x08";

}  // namespace

PickleOutput::PickleOutput() : out_(kProtocol) {}

PickleOutput& PickleOutput::begin_dict() {
  out_ += kEmptyDict;
  out_ += kMark;
  return *this;
}

PickleOutput& PickleOutput::end_dict() {
  out_ += kSetItems;
  return *this;
}

PickleOutput& PickleOutput::little(std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) out_ += static_cast<char>(value >> (8 * i) & 0xff);
  return *this;
}

PickleOutput& PickleOutput::text(std::string_view value) {
  out_ += kText;
  little(value.size(), 4);
  out_ += value;
  return *this;
}

PickleOutput& PickleOutput::real(double value) {
  out_ += kFloat;
  const auto bits = std::bit_cast<std::uint64_t>(value);
  for (int i = 7; i >= 0; --i) out_ += static_cast<char>(bits >> (8 * i) & 0xff);
  return *this;
}

PickleOutput& PickleOutput::rate(double rate_hz) {
  return is_whole(rate_hz) ? integer(static_cast<std::int64_t>(rate_hz)) : real(rate_hz);
}

PickleOutput& PickleOutput::integer(std::int64_t value) {
  const bool small =
      value >= std::numeric_limits<std::int32_t>::min() && value <= std::numeric_limits<std::int32_t>::max();
  out_ += small ? kInt : kLong;
  return little(static_cast<std::uint64_t>(value), small ? 4 : 8);
}

PickleOutput& PickleOutput::texts(std::span<const std::string> values) {
  out_ += kEmptyList;
  out_ += kMark;
  for (const std::string& value : values) text(value);
  out_ += kAppends;
  return *this;
}

PickleOutput& PickleOutput::call(std::string_view module, std::string_view name) {
  text(module).text(name);
  out_ += kGlobal;
  return *this;
}

PickleOutput& PickleOutput::bytes(std::string_view value) {
  const bool large = value.size() > std::numeric_limits<std::uint32_t>::max();
  out_ += large ? kBytes8 : kBytes;
  little(value.size(), large ? 8 : 4);
  out_ += value;
  return *this;
}

PickleOutput& PickleOutput::array(const std::vector<std::size_t>& shape, std::span<const double> values) {
  std::size_t count = 1;
  for (const std::size_t size : shape) count *= size;
  require(count == values.size(), "a pickled array: shape and number of values disagree");
  static_assert(std::endian::native == std::endian::little);
  // _reconstruct(ndarray, (0,), b"b"), then its state: (1, shape, dtype, False, bytes).
  call("numpy.core.multiarray", "_reconstruct").call("numpy", "ndarray").integer(0);
  out_ += kTuple1;
  bytes("b");
  out_.append(kTuple3).append(kReduce).append(kMark);
  integer(1);
  out_ += kMark;
  for (const std::size_t size : shape) integer(static_cast<std::int64_t>(size));
  out_ += kTuple;
  // dtype("f8", False, True), then its state: (3, "<", None, None, None, -1, -1, 0).
  call("numpy", "dtype").text("f8");
  out_.append(kFalse).append(kTrue).append(kTuple3).append(kReduce).append(kMark);
  integer(3).text("<");
  out_.append(kNone).append(kNone).append(kNone);
  integer(-1).integer(-1).integer(0);
  out_.append(kTuple).append(kBuild).append(kFalse);
  bytes({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double)});
  out_.append(kTuple).append(kBuild);
  return *this;
}

std::string PickleOutput::finish() {
  out_ += kStop;
  return std::move(out_);
}

}  // namespace duet
