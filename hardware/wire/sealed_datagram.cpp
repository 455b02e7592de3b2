#include "duet/hardware/wire/sealed_datagram.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <numeric>
#include <stdexcept>

#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::uint32_t kSealedVersion = 0x314E5544;  // "DUN1"

struct HeadWire {
  std::uint32_t version;
  std::uint16_t kind, sender;
  std::uint64_t ticket, sequence;
  double clock;
};
static_assert(sizeof(HeadWire) == kSealedHeadBytes && std::endian::native == std::endian::little);

using Seal = std::array<std::byte, kSealBytes>;

Seal seal_of(const NetworkKey& key, std::span<const std::byte> bytes) {
  Seal made;
  unsigned int size = 0;
  const unsigned char* done =
      HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), reinterpret_cast<const unsigned char*>(bytes.data()),
           bytes.size(), reinterpret_cast<unsigned char*>(made.data()), &size);
  if (done == nullptr || size != made.size()) throw std::runtime_error("OpenSSL: cannot make an HMAC-SHA256");
  return made;
}

void fill_at_random(std::span<std::byte> bytes) {
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw std::runtime_error(fmt::format("the system gives no random numbers: {}", std::strerror(errno)));
}

constexpr std::string_view kSealRefusalTexts[kSealRefusals] = {
    "",
    "shorter than a head and a seal",
    "longer than any that is known",
    "not of this form, or of another version",
    "another key, or altered on its way",
    "a kind that nobody sends here",
    "its sender's number is above 15",
    "its ticket is older than a second, or of another start of the guard",
    "its number does not rise: sent twice, overtaken, or two senders with one number",
    "its sender's clock is not finite, or falls",
    "it came 0.25 s later than the fastest",
    "nobody on this computer takes it",
};

}  // namespace

NetworkKey read_network_key(const std::string& path) {
  struct stat found {};
  if (stat(path.c_str(), &found) != 0 || !S_ISREG(found.st_mode))
    throw InputError(fmt::format("key '{}': expected a file ('duet hw key' makes one), found none", path));
  if ((found.st_mode & 077) != 0)
    throw InputError(fmt::format("key '{}': expected a file that only its owner may use (chmod 600), found mode {:o}",
                                 path, found.st_mode & 0777));
  std::string text = read_text(path);
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  NetworkKey key;
  bool good = text.size() == 2 * key.size();
  for (std::size_t k = 0; good && k < key.size(); ++k) {
    unsigned int byte = 0;
    const char* begin = text.data() + 2 * k;
    const auto [end, error] = std::from_chars(begin, begin + 2, byte, 16);
    good = error == std::errc() && end == begin + 2;
    key[k] = static_cast<std::byte>(byte);
  }
  if (!good)
    throw InputError(fmt::format("key '{}': expected {} hexadecimal digits, found something else ({} characters)", path,
                                 2 * key.size(), text.size()));
  return key;
}

void make_network_key(const std::string& path) {
  NetworkKey key;
  fill_at_random(key);
  std::string text;
  for (const std::byte byte : key) text += fmt::format("{:02x}", std::to_integer<int>(byte));
  text += '\n';
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0 && errno == EEXIST)
    throw InputError(fmt::format("key '{}': expected a path where no file is, found one", path));
  const bool written = file >= 0 && write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const bool closed = file >= 0 && close(file) == 0;
  if (written && closed) return;
  const int why = errno;
  if (file >= 0) unlink(path.c_str());
  throw StorageError(fmt::format("key '{}': cannot be written: {}", path, std::strerror(why)));
}

std::uint64_t random_number() {
  std::uint64_t number = 0;
  fill_at_random(std::as_writable_bytes(std::span(&number, 1)));
  return number >> 2;
}

long refused_datagrams(const NetworkCounts& counts) { return std::accumulate(counts.begin() + 1, counts.end(), 0L); }

std::string network_counts_text(const NetworkCounts& counts) {
  const long refused = refused_datagrams(counts);
  if (counts[0] + refused == 0) return "";
  std::string why;
  for (std::size_t k = 1; k < kSealRefusals; ++k)
    if (counts[k] > 0)
      why +=
          fmt::format("{}{} {} ({})", why.empty() ? ": " : ", ", counts[k], kSealRefusalNames[k], kSealRefusalTexts[k]);
  return fmt::format("network: {} taken, {} refused{}", counts[0], refused, why);
}

std::size_t seal(const NetworkKey& key, const SealedHead& head, std::span<const std::byte> carried,
                 SealedBuffer& buffer) {
  require(carried.size() <= kMostSealed, "a sealed datagram: expected at most {} bytes, found {}", kMostSealed,
          carried.size());
  const HeadWire wire{kSealedVersion, static_cast<std::uint16_t>(head.kind), head.sender, head.ticket, head.sequence,
                      head.clock};
  std::memcpy(buffer.data(), &wire, sizeof(wire));
  std::ranges::copy(carried, buffer.begin() + kSealedHeadBytes);
  const std::size_t size = kSealedHeadBytes + carried.size();
  std::ranges::copy(seal_of(key, std::span<const std::byte>(buffer).first(size)),
                    buffer.begin() + static_cast<std::ptrdiff_t>(size));
  return size + kSealBytes;
}

SealRefusal unseal(const NetworkKey& key, std::span<const std::byte> datagram, SealedHead& head,
                   std::span<const std::byte>& carried) {
  if (datagram.size() < kSealedHeadBytes + kSealBytes) return SealRefusal::kShort;
  if (datagram.size() > kMostSealedBytes) return SealRefusal::kLong;
  HeadWire wire;
  std::memcpy(&wire, datagram.data(), sizeof(wire));
  if (wire.version != kSealedVersion) return SealRefusal::kVersion;
  const std::span<const std::byte> before = datagram.first(datagram.size() - kSealBytes);
  const Seal expected = seal_of(key, before);
  // Takes as long whichever byte differs.
  if (CRYPTO_memcmp(expected.data(), datagram.last(kSealBytes).data(), kSealBytes) != 0) return SealRefusal::kForged;
  if (wire.kind == 0 || wire.kind > kSealedKinds) return SealRefusal::kKind;
  head = {static_cast<SealedKind>(wire.kind), wire.sender, wire.ticket, wire.sequence, wire.clock};
  carried = before.subspan(kSealedHeadBytes);
  return SealRefusal::kNone;
}

namespace {

constexpr double kMicroseconds = 1e6;

std::uint64_t microseconds(double now) { return static_cast<std::uint64_t>(now * kMicroseconds); }

}  // namespace

std::uint64_t SealGate::ticket(double now) const { return secret_ + microseconds(now); }

std::uint64_t SealGate::largest(std::uint16_t sender) const {
  std::uint64_t most = 0;
  for (const auto& [of, stream] : streams_)
    if (of.first == sender) most = std::max(most, stream.sequence);
  return most;
}

SealRefusal SealGate::takes(const SealedHead& head, double now) {
  if (head.sender >= kMostSenders) return SealRefusal::kSender;
  // One that was never given, or is from another start, is beyond by the wrap of unsigned numbers.
  if (microseconds(now) - (head.ticket - secret_) > microseconds(kTicketLife)) return SealRefusal::kTicket;
  const auto found = streams_.find({head.sender, head.kind});
  if (found != streams_.end() && head.sequence <= found->second.sequence) return SealRefusal::kRepeated;
  const bool goes_on = found != streams_.end() && now - found->second.at <= kSenderSilence;
  if (!std::isfinite(head.clock) || (goes_on && head.clock <= found->second.clock)) return SealRefusal::kClock;
  Stream& stream = streams_[{head.sender, head.kind}];
  stream.sequence = head.sequence;
  stream.clock = head.clock;
  stream.at = now;
  return stream.delay.see(head.clock, now) > kLatestDatagram ? SealRefusal::kLate : SealRefusal::kNone;
}

}  // namespace duet
