#include "duet/hardware/lcm_message.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <tuple>

namespace duet {
namespace {

constexpr std::uint32_t kMagic = 0x4C433032;  // "LC02"

// Wraps around; the right shift carries the sign on.
std::int64_t hashed(std::int64_t hash, std::int64_t value) {
  const std::uint64_t mixed = (static_cast<std::uint64_t>(hash) << 8) ^ static_cast<std::uint64_t>(hash >> 55);
  return static_cast<std::int64_t>(mixed + static_cast<std::uint64_t>(value));
}

std::int64_t hashed(std::int64_t hash, std::string_view text) {
  hash = hashed(hash, static_cast<std::int64_t>(text.size()));
  for (const char c : text) hash = hashed(hash, static_cast<std::int64_t>(c));
  return hash;
}

// The fields of each message, as values and by name.
auto fields(auto& message) requires requires { message.command; }
{ return std::tie(message.command); }
auto fields(auto& message) requires requires { message.act; }
{ return std::tie(message.act); }
auto fields(auto& message) requires requires { message.q_des; }
{ return std::tie(message.q_des, message.tau_ff, message.timestamp_us); }
auto fields(auto& message) requires requires { message.qd; }
{ return std::tie(message.q, message.qd, message.timestamp_us); }

constexpr LcmField kPedalFields[] = {{"command", "double", 4}};
constexpr LcmField kArmFields[] = {{"act", "double", kLcmArmJoints}};
constexpr LcmField kTargetFields[] = {
    {"q_des", "double", kLcmJoints}, {"tau_ff", "double", kLcmJoints}, {"timestamp_us", "int64_t"}};
constexpr LcmField kBodyFields[] = {
    {"q", "float", kLcmJoints}, {"qd", "float", kLcmJoints}, {"timestamp_us", "int64_t"}};

std::span<const LcmField> names(const PedalCommand&) { return kPedalFields; }
std::span<const LcmField> names(const ArmAction&) { return kArmFields; }
std::span<const LcmField> names(const PdTargets&) { return kTargetFields; }
std::span<const LcmField> names(const BodyControlData&) { return kBodyFields; }

template <typename Message>
std::uint64_t fingerprint() {
  static const std::uint64_t value = std::rotl(lcm_hash(names(Message{})), 1);
  return value;
}

template <typename T>
using Bits = std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t>;

// Writes and reads big-endian, and never past the end.
struct LcmWriter {
  std::span<std::byte> bytes;
  std::size_t at = 0;

  template <typename T>
  void put(T value) {
    const auto bits = std::bit_cast<Bits<T>>(value);
    for (int shift = 8 * (static_cast<int>(sizeof(T)) - 1); shift >= 0; shift -= 8)
      bytes[at++] = static_cast<std::byte>(bits >> shift);
  }
  template <typename T, std::size_t N>
  void put(const std::array<T, N>& values) {
    for (const T value : values) put(value);
  }
  void put(std::string_view text) {
    std::memcpy(bytes.data() + at, text.data(), text.size());
    at += text.size();
    bytes[at++] = std::byte{0};
  }
};

struct LcmReader {
  std::span<const std::byte> bytes;
  std::size_t at = 0;
  bool short_of = false;

  template <typename T>
  void get(T& value) {
    if (bytes.size() - at < sizeof(T)) {
      short_of = true;
      return;
    }
    Bits<T> bits = 0;
    for (std::size_t k = 0; k < sizeof(T); ++k) bits = bits << 8 | static_cast<Bits<T>>(bytes[at++]);
    value = std::bit_cast<T>(bits);
  }
  template <typename T, std::size_t N>
  void get(std::array<T, N>& values) {
    for (T& value : values) get(value);
  }
  bool get_channel(std::string_view expected) {
    if (bytes.size() - at <= expected.size()) return false;
    const bool same = std::memcmp(bytes.data() + at, expected.data(), expected.size()) == 0;
    at += expected.size();
    return same && bytes[at++] == std::byte{0};
  }
};

template <typename Message>
std::size_t encode_message(const Message& message, std::uint32_t sequence, LcmBuffer& buffer) {
  LcmWriter writer{buffer};
  writer.put(kMagic);
  writer.put(sequence);
  writer.put(Message::kChannel);
  writer.put(fingerprint<Message>());
  std::apply([&](const auto&... values) { (writer.put(values), ...); }, fields(message));
  return writer.at;
}

template <typename Message>
LcmReading decode_message(std::span<const std::byte> datagram, Message& message) {
  LcmReader reader{datagram};
  LcmReading reading;
  std::uint32_t magic = 0;
  std::uint64_t type = 0;
  reader.get(magic);
  reader.get(reading.sequence);
  if (reader.short_of || magic != kMagic) return {0, "expected a datagram of LCM, found another"};
  if (!reader.get_channel(Message::kChannel)) return {0, "expected a message of this channel, found another"};
  reader.get(type);
  if (reader.short_of || type != fingerprint<Message>())
    return {0, "expected a message of this channel's type, found another"};
  Message read;
  std::apply([&](auto&... values) { (reader.get(values), ...); }, fields(read));
  if (reader.short_of) return {0, "expected a whole message, found a shorter one"};
  if (reader.at != datagram.size()) return {0, "expected the end of the message, found more"};
  message = read;
  return reading;
}

}  // namespace

std::uint64_t lcm_hash(std::span<const LcmField> known) {
  std::int64_t hash = 0x12345678;
  for (const LcmField& field : known) {
    hash = hashed(hash, field.name);
    hash = hashed(hash, field.type);
    hash = hashed(hash, std::int64_t{field.count > 0 ? 1 : 0});
    if (field.count <= 0) continue;
    hash = hashed(hash, std::int64_t{0});  // a size that is a constant
    hash = hashed(hash, fmt::format_int(field.count).c_str());
  }
  return static_cast<std::uint64_t>(hash);
}

std::size_t encode(const PedalCommand& m, std::uint32_t sequence, LcmBuffer& b) {
  return encode_message(m, sequence, b);
}
std::size_t encode(const ArmAction& m, std::uint32_t sequence, LcmBuffer& b) { return encode_message(m, sequence, b); }
std::size_t encode(const PdTargets& m, std::uint32_t sequence, LcmBuffer& b) { return encode_message(m, sequence, b); }
std::size_t encode(const BodyControlData& m, std::uint32_t sequence, LcmBuffer& b) {
  return encode_message(m, sequence, b);
}

LcmReading decode(std::span<const std::byte> d, PedalCommand& message) { return decode_message(d, message); }
LcmReading decode(std::span<const std::byte> d, ArmAction& message) { return decode_message(d, message); }
LcmReading decode(std::span<const std::byte> d, PdTargets& message) { return decode_message(d, message); }
LcmReading decode(std::span<const std::byte> d, BodyControlData& message) { return decode_message(d, message); }

}  // namespace duet
