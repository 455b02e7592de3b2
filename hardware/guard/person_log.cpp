#include "duet/hardware/guard/person_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kLongest = 86400.0;  // of a log [s]
constexpr std::size_t kStampAt = 16;  // in a message

std::span<const std::byte> bytes_of(std::string_view text) { return std::as_bytes(std::span(text)); }

// The size of the message that begins here; 0 where none does.
std::size_t length_of(std::string_view bytes) {
  if (bytes.starts_with("DPJ2")) return kPersonBytes;
  return bytes.starts_with("DPJ1") ? kFirstPersonBytes : 0;
}

}  // namespace

std::vector<RecordedEstimate> parse_person_log(std::string_view bytes, const std::string& name) {
  std::vector<RecordedEstimate> log;
  double first = 0.0;
  for (std::size_t at = 0; at < bytes.size();) {
    const auto fail = [&](const std::string& found) {
      throw InputError(
          fmt::format("'{}': message {} (byte {}): expected an estimate of a person of {} or {} bytes, with "
                      "a time of at most a day that does not fall, found {}",
                      excerpt(name), log.size() + 1, at, kFirstPersonBytes, kPersonBytes, found));
    };
    const std::size_t length = length_of(bytes.substr(at));
    if (length == 0) fail("another beginning than 'DPJ1' or 'DPJ2'");
    if (bytes.size() - at < length) fail(fmt::format("{} bytes", bytes.size() - at));
    double stamp = 0.0;
    std::memcpy(&stamp, bytes.data() + at + kStampAt, sizeof(stamp));
    if (log.empty()) first = stamp;
    const double time = stamp - first;
    if (!std::isfinite(stamp) || time > kLongest || time < (log.empty() ? 0.0 : log.back().at))
      fail(fmt::format("a time of {:.3f} s after the first", time));
    log.push_back({time, std::string(bytes.substr(at, length))});
    at += length;
  }
  if (log.empty()) throw InputError(fmt::format("'{}': expected estimates of a person, found nothing", excerpt(name)));
  return log;
}

std::vector<RecordedEstimate> read_person_log(const std::string& path) {
  return parse_person_log(read_file(path), path);
}

RecordedEstimate recorded(const PersonEstimate& estimate) {
  PersonBuffer buffer;
  encode(estimate, buffer);
  return {estimate.stamp, std::string(reinterpret_cast<const char*>(buffer.data()), buffer.size())};
}

std::string person_log(std::span<const RecordedEstimate> estimates) {
  std::string text;
  for (const RecordedEstimate& estimate : estimates) text += estimate.bytes;
  return text;
}

PersonCounts counts_of(std::span<const RecordedEstimate> estimates) {
  PersonCounts counts{};
  PersonEstimate read;
  for (const RecordedEstimate& estimate : estimates) {
    PersonFault fault = decode(bytes_of(estimate.bytes), read);
    if (fault == PersonFault::kNone && !read.seen) fault = PersonFault::kUnseen;
    ++counts[static_cast<std::size_t>(fault)];
  }
  return counts;
}

}  // namespace duet
