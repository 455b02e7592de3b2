#include "duet/hardware/wire/lcm_message.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <bit>
#include <cerrno>
#include <cstring>
#include <stdexcept>
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

namespace {

[[noreturn]] void refuse_group(const LcmPlace& place, const char* what) {
  throw std::runtime_error(fmt::format("LCM: cannot {} {}:{} on interface '{}': {}", what, place.group, place.port,
                                       place.interface, std::strerror(errno)));
}

sockaddr_in address_of_group(const LcmPlace& place) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(place.port));
  if (inet_pton(AF_INET, place.group.c_str(), &address.sin_addr) != 1 || !IN_MULTICAST(ntohl(address.sin_addr.s_addr)))
    throw std::runtime_error(fmt::format("LCM: expected the address of a multicast group, found '{}'", place.group));
  return address;
}

ip_mreqn membership(const LcmPlace& place) {
  ip_mreqn request{};
  request.imr_multiaddr = address_of_group(place).sin_addr;
  request.imr_ifindex = static_cast<int>(if_nametoindex(place.interface.c_str()));
  if (request.imr_ifindex == 0) refuse_group(place, "use");
  return request;
}

int nonblocking_socket(const LcmPlace& place) {
  const int descriptor = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (descriptor < 0) refuse_group(place, "make a socket for");
  return descriptor;
}

template <typename Value>
bool set_option(int descriptor, int level, int name, const Value& value) {
  return setsockopt(descriptor, level, name, &value, sizeof(value)) == 0;
}

}  // namespace

LcmChannel::LcmChannel(const LcmPlace& place) {
  try {
    join(place);
    connect_to(place);
  } catch (...) {
    if (receives_ >= 0) close(receives_);
    if (sends_ >= 0) close(sends_);
    throw;
  }
}

LcmChannel::~LcmChannel() {
  close(receives_);
  close(sends_);
}

void LcmChannel::join(const LcmPlace& place) {
  const sockaddr_in group = address_of_group(place);
  const ip_mreqn request = membership(place);
  receives_ = nonblocking_socket(place);
  const bool shares = set_option(receives_, SOL_SOCKET, SO_REUSEADDR, 1);
  if (!shares || bind(receives_, reinterpret_cast<const sockaddr*>(&group), sizeof(group)) != 0)
    refuse_group(place, "receive at");
  if (!set_option(receives_, IPPROTO_IP, IP_ADD_MEMBERSHIP, request)) refuse_group(place, "join");
}

// Connected, so that its own address is known: that of what the group gives back.
void LcmChannel::connect_to(const LcmPlace& place) {
  const sockaddr_in group = address_of_group(place);
  const ip_mreqn request = membership(place);
  sends_ = nonblocking_socket(place);
  const auto hops = static_cast<unsigned char>(place.hops);
  if (!set_option(sends_, IPPROTO_IP, IP_MULTICAST_IF, request) ||
      !set_option(sends_, IPPROTO_IP, IP_MULTICAST_TTL, hops))
    refuse_group(place, "send to");
  if (connect(sends_, reinterpret_cast<const sockaddr*>(&group), sizeof(group)) != 0) refuse_group(place, "send to");
  sockaddr_in own{};
  socklen_t length = sizeof(own);
  if (getsockname(sends_, reinterpret_cast<sockaddr*>(&own), &length) != 0) refuse_group(place, "send to");
  own_address_ = own.sin_addr.s_addr;
  own_port_ = own.sin_port;
}

bool LcmChannel::send(std::span<const std::byte> datagram) {
  return ::send(sends_, datagram.data(), datagram.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(datagram.size());
}

std::size_t LcmChannel::receive(std::span<std::byte> buffer, bool& own) {
  sockaddr_in from{};
  socklen_t length = sizeof(from);
  const ssize_t size =
      recvfrom(receives_, buffer.data(), buffer.size(), 0, reinterpret_cast<sockaddr*>(&from), &length);
  if (size <= 0) return 0;
  own = from.sin_port == own_port_ && from.sin_addr.s_addr == own_address_;
  return static_cast<std::size_t>(size);
}

}  // namespace duet
