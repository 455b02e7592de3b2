// Datagrams between two computers that share a key: whoever lacks it can neither make nor alter nor repeat one. Each
// has a head of 32 bytes (number of the form, kind, sender, ticket, sequence, the sender's clock), the bytes that it
// carries, and HMAC-SHA256 of all before: docs/hardware.md, "Over a network". Nothing is encrypted. A ticket is the
// receiver's clock in disguise: it bounds how old a datagram is without a clock that both computers share, and what was
// recorded of an earlier run bears none. Pure functions but for the key's file. One owner, one thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "duet/hardware/wire/sender_clock.h"

namespace duet {

using NetworkKey = std::array<std::byte, 32>;

// A file of 64 hexadecimal digits that only its owner may read. Throws InputError; no message has a digit of it.
NetworkKey read_network_key(const std::string& path);
// Makes one by the system's random numbers, for its owner alone. Throws InputError where the file is there already, and
// StorageError.
void make_network_key(const std::string& path);
// 62 of the system's random bits.
std::uint64_t random_number();

enum class SealedKind : std::uint16_t {
  kHello = 1,   // asks for a ticket
  kTicket,      // the answer: u64 sequence of the hello, u64 largest sequence taken of that sender
  kGuard,       // a message to the guard's socket (hardware/guard/guard_message.h): plan or stop
  kPerson,      // an estimate (hardware/guard/person_input.h)
  kPose,        // an external tracker's (hardware/wire/odometry_source.h)
  kAskReports,  // reports to this address for a second; u64 that each bears as its ticket
  kReport,
  kAskStatus,  // the same of the status
  kStatus,
};
inline constexpr std::uint16_t kSealedKinds = 9;

struct SealedHead {
  SealedKind kind = SealedKind::kHello;
  std::uint16_t sender = 0;    // 0 to 15
  std::uint64_t ticket = 0;    // 0 in a hello
  std::uint64_t sequence = 0;  // rises, over all that this sender sends
  double clock = 0.0;          // the sender's, rises [s]
};
inline constexpr std::size_t kSealedHeadBytes = 32, kSealBytes = 32, kMostSealed = 8192;
inline constexpr std::size_t kMostSealedBytes = kSealedHeadBytes + kMostSealed + kSealBytes;
inline constexpr std::uint16_t kMostSenders = 16;
using SealedBuffer = std::array<std::byte, kMostSealedBytes>;

// Why a datagram is not taken, in the order in which it is asked.
enum class SealRefusal {
  kNone,
  kShort,
  kLong,
  kVersion,
  kForged,
  kKind,
  kSender,
  kTicket,
  kRepeated,
  kClock,
  kLate,
  kUnwanted
};
inline constexpr std::size_t kSealRefusals = 12;
inline constexpr std::array<std::string_view, kSealRefusals> kSealRefusalNames = {
    "none", "short", "long", "version", "forged", "kind", "sender", "ticket", "repeated", "clock", "late", "unwanted"};
// How many datagrams met each; those without a refusal were taken.
using NetworkCounts = std::array<long, kSealRefusals>;
long refused_datagrams(const NetworkCounts& counts);
// "network: 120 taken, 31 refused: 30 forged (another key, or altered on its way), 1 late (...)"; "" where none came.
std::string network_counts_text(const NetworkCounts& counts);

// The datagram's length in `buffer`. At most kMostSealed bytes; throws std::invalid_argument for more.
std::size_t seal(const NetworkKey& key, const SealedHead& head, std::span<const std::byte> carried,
                 SealedBuffer& buffer);
// kShort to kKind, or kNone: then `head` and `carried`, a part of `datagram`, are set.
SealRefusal unseal(const NetworkKey& key, std::span<const std::byte> datagram, SealedHead& head,
                   std::span<const std::byte>& carried);

inline constexpr double kTicketLife = 1.0;       // [s]
inline constexpr double kLatestDatagram = 0.25;  // later than the fastest by the sender's clock, is refused [s]

// The receiver's memory of its senders: which tickets it gave, and what each sent last. What is not taken changes
// nothing but for a datagram that is late, whose number counts.
class SealGate {
 public:
  // `secret`: random, another at each start.
  explicit SealGate(std::uint64_t secret) : secret_(secret) {}

  // `now`, here and below, by the receiver's clock [s].
  [[nodiscard]] std::uint64_t ticket(double now) const;
  // kSender to kLate, or kNone.
  SealRefusal takes(const SealedHead& head, double now);
  // Largest sequence taken of that sender; 0 where none was.
  [[nodiscard]] std::uint64_t largest(std::uint16_t sender) const;

 private:
  struct Stream {
    std::uint64_t sequence = 0;
    double clock = 0.0, at = 0.0;
    SenderDelay delay;
  };
  std::uint64_t secret_;
  std::map<std::pair<std::uint16_t, SealedKind>, Stream> streams_;  // of those with the key: at most 16 of each kind
};

}  // namespace duet
