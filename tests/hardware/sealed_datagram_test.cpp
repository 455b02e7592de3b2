// Sealed datagrams: the bytes of one, each reason for which one is refused, and the key's file.
#include "duet/hardware/wire/sealed_datagram.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "tests/support.h"

namespace duet {
namespace {

NetworkKey some_key(int first = 0) {
  NetworkKey key;
  for (std::size_t k = 0; k < key.size(); ++k) key[k] = static_cast<std::byte>(first + static_cast<int>(k));
  return key;
}

std::vector<std::byte> sealed(const SealedHead& head, std::string_view carried = "plan", int key = 0) {
  SealedBuffer buffer;
  const std::size_t size = seal(some_key(key), head, std::as_bytes(std::span(carried)), buffer);
  return {buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size)};
}

SealRefusal read(const std::vector<std::byte>& datagram, SealedHead* found = nullptr) {
  SealedHead head;
  std::span<const std::byte> carried;
  const SealRefusal refusal = unseal(some_key(), datagram, head, carried);
  if (found != nullptr) *found = head;
  return refusal;
}

const SealedHead kPlan{SealedKind::kGuard, 3, 77, 12, 4.5};

TEST(SealedDatagram, ArrivesAsItWasSealed) {
  const std::vector<std::byte> datagram = sealed(kPlan);
  ASSERT_EQ(datagram.size(), kSealedHeadBytes + 4 + kSealBytes);
  SealedHead head;
  std::span<const std::byte> carried;
  ASSERT_EQ(unseal(some_key(), datagram, head, carried), SealRefusal::kNone);
  EXPECT_EQ(head.kind, SealedKind::kGuard);
  EXPECT_EQ(head.sender, 3);
  EXPECT_EQ(head.ticket, 77u);
  EXPECT_EQ(head.sequence, 12u);
  EXPECT_EQ(head.clock, 4.5);
  ASSERT_EQ(carried.size(), 4u);
  EXPECT_EQ(std::memcmp(carried.data(), "plan", 4), 0);
}

// By Python's hmac and struct: hmac.new(bytes(range(32)), struct.pack('<IHHQQd', 0x314E5544, 3, 3, 77, 12, 4.5) +
// b'plan', 'sha256').
TEST(SealedDatagram, HasTheSealThatAnotherProgramMakes) {
  const std::vector<std::byte> datagram = sealed(kPlan);
  std::string seal;
  for (std::size_t k = datagram.size() - kSealBytes; k < datagram.size(); ++k)
    seal += "0123456789abcdef"[std::to_integer<int>(datagram[k]) >> 4],
        seal += "0123456789abcdef"[std::to_integer<int>(datagram[k]) & 15];
  EXPECT_EQ(seal, "1e2818a3d6f0581fceb80f41bc2285f06bc4667ff41ae8d918b23a985a0dc258");
}

TEST(SealedDatagram, WhatIsAlteredAnywhereIsForgedOrAnotherVersion) {
  const std::vector<std::byte> good = sealed(kPlan);
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::vector<std::byte> datagram = good;
    datagram[at] ^= std::byte{1};
    EXPECT_EQ(read(datagram), at < 4 ? SealRefusal::kVersion : SealRefusal::kForged) << at;
  }
  EXPECT_EQ(read(sealed(kPlan, "plan", 1)), SealRefusal::kForged) << "another key";
}

TEST(SealedDatagram, WhatIsCutOrTooLongIsRefused) {
  const std::vector<std::byte> good = sealed(kPlan);
  for (std::size_t size = 0; size < good.size(); ++size) {
    const std::vector<std::byte> cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_EQ(read(cut), size < kSealedHeadBytes + kSealBytes ? SealRefusal::kShort : SealRefusal::kForged) << size;
  }
  EXPECT_EQ(read(std::vector<std::byte>(kMostSealedBytes + 1)), SealRefusal::kLong);
  EXPECT_EQ(read(sealed(kPlan, std::string(kMostSealed, 'x'))), SealRefusal::kNone);
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { (void)sealed(kPlan, std::string(kMostSealed + 1, 'x')); }));
}

TEST(SealedDatagram, AKindThatNobodyKnowsIsRefused) {
  for (const int kind : {0, 10, 65535})
    EXPECT_EQ(read(sealed({static_cast<SealedKind>(kind), 3, 77, 12, 4.5})), SealRefusal::kKind);
}

TEST(SealedDatagram, ChangedAtRandomItIsNeverTaken) {
  Random random(7, 10);
  for (int k = 0; k < 20000; ++k) {
    std::vector<std::byte> datagram = sealed(kPlan);
    const std::size_t at = static_cast<std::size_t>(random.below(static_cast<int>(datagram.size())));
    datagram[at] ^= static_cast<std::byte>(1 + random.below(255));
    if (random.chance(0.2)) datagram.resize(static_cast<std::size_t>(random.below(static_cast<int>(datagram.size()))));
    EXPECT_NE(read(datagram), SealRefusal::kNone);
  }
}

// A gate at second 100, and a sender whose clock has nothing to do with that.
struct SomeGate {
  SealGate gate{0x123456789abcull};
  double now = 100.0;
  SealedHead head{SealedKind::kGuard, 3, 0, 0, -5000.0};

  SealRefusal next(double passed = 0.02) {
    now += passed;
    head.clock += passed;
    ++head.sequence;
    head.ticket = gate.ticket(now - 0.05);
    return gate.takes(head, now);
  }
};

TEST(SealGate, TakesWhatRisesWithAFreshTicket) {
  SomeGate some;
  for (int k = 0; k < 100; ++k) EXPECT_EQ(some.next(), SealRefusal::kNone);
  EXPECT_EQ(some.gate.largest(3), 100u);
  EXPECT_EQ(some.gate.largest(4), 0u);
}

TEST(SealGate, WhatIsSentTwiceOrOvertakenIsRefused) {
  SomeGate some;
  ASSERT_EQ(some.next(), SealRefusal::kNone);
  const SealedHead first = some.head;
  ASSERT_EQ(some.next(), SealRefusal::kNone);
  EXPECT_EQ(some.gate.takes(some.head, some.now), SealRefusal::kRepeated);
  EXPECT_EQ(some.gate.takes(first, some.now), SealRefusal::kRepeated);
  // Also after a silence: nobody counts from a low number again, as the ticket says where to go on.
  EXPECT_EQ(some.gate.takes({first.kind, first.sender, some.gate.ticket(some.now + 10.0), first.sequence, 0.0},
                            some.now + 10.0),
            SealRefusal::kRepeated);
}

TEST(SealGate, ATicketLivesForASecondAndOneOfAnotherStartNotAtAll) {
  SomeGate some;
  ASSERT_EQ(some.next(), SealRefusal::kNone);
  SealedHead head = some.head;
  ++head.sequence;
  head.clock += 0.02;
  head.ticket = some.gate.ticket(some.now - 1.01);
  EXPECT_EQ(some.gate.takes(head, some.now), SealRefusal::kTicket);
  head.ticket = some.gate.ticket(some.now + 0.01);
  EXPECT_EQ(some.gate.takes(head, some.now), SealRefusal::kTicket) << "not given yet";
  for (const std::uint64_t ticket : {std::uint64_t{0}, ~std::uint64_t{0}, SealGate(1).ticket(some.now)}) {
    head.ticket = ticket;
    EXPECT_EQ(some.gate.takes(head, some.now), SealRefusal::kTicket);
  }
  head.ticket = some.gate.ticket(some.now - 0.99);
  EXPECT_EQ(some.gate.takes(head, some.now), SealRefusal::kNone);
}

TEST(SealGate, ASendersClockHasToRiseAndBeFinite) {
  SomeGate some;
  ASSERT_EQ(some.next(), SealRefusal::kNone);
  SealedHead head = some.head;
  ++head.sequence;
  for (const double clock : {head.clock, head.clock - 1.0, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
    head.clock = clock;
    EXPECT_EQ(some.gate.takes(head, some.now + 0.02), SealRefusal::kClock) << clock;
  }
  // A computer that was started anew.
  head.ticket = some.gate.ticket(some.now + 1.0);
  head.clock = 3.0;
  EXPECT_EQ(some.gate.takes(head, some.now + 1.0), SealRefusal::kNone);
}

TEST(SealGate, WhatComesLaterThanTheFastestIsRefusedAsLate) {
  SomeGate some;
  for (int k = 0; k < 50; ++k) ASSERT_EQ(some.next(), SealRefusal::kNone);
  some.now += 0.2;  // stays behind from here on
  EXPECT_EQ(some.next(), SealRefusal::kNone);
  some.now += 0.06;
  EXPECT_EQ(some.next(), SealRefusal::kLate);
  EXPECT_EQ(some.gate.takes(some.head, some.now), SealRefusal::kRepeated) << "its number counted";
  some.now -= 0.06;
  EXPECT_EQ(some.next(), SealRefusal::kNone);
}

TEST(SealGate, StreamsAndSendersDoNotDisturbEachOther) {
  SomeGate some;
  ASSERT_EQ(some.next(), SealRefusal::kNone);
  SealedHead head = some.head;
  head.kind = SealedKind::kPerson;
  EXPECT_EQ(some.gate.takes(head, some.now), SealRefusal::kNone);
  head.sender = 4;
  head.clock = 1e9;
  EXPECT_EQ(some.gate.takes(head, some.now), SealRefusal::kNone);
  head.sender = kMostSenders;
  EXPECT_EQ(some.gate.takes(head, some.now), SealRefusal::kSender);
  EXPECT_EQ(some.next(), SealRefusal::kNone);
}

TEST(NetworkKey, IsMadeForItsOwnerAndReadAgain) {
  const test::ScratchFolder folder;
  make_network_key(folder / "guard.key");
  EXPECT_EQ(std::filesystem::status(folder / "guard.key").permissions() & std::filesystem::perms::all,
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  EXPECT_EQ(read_network_key(folder / "guard.key"), read_network_key(folder / "guard.key"));
  make_network_key(folder / "other.key");
  EXPECT_NE(read_network_key(folder / "guard.key"), read_network_key(folder / "other.key"));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { make_network_key(folder / "guard.key"); }));
  EXPECT_SENTENCE(test::thrown_message<StorageError>([&] { make_network_key(folder / "absent" + "/guard.key"); }));
}

TEST(NetworkKey, ThatOthersMayReadOrThatIsNoneIsRefused) {
  const test::ScratchFolder folder;
  const auto refusal = [&](const std::string& name) {
    return test::thrown_message<InputError>([&] { (void)read_network_key(folder / name); });
  };
  EXPECT_SENTENCE(refusal("absent.key"));
  make_network_key(folder / "open.key");
  std::filesystem::permissions(folder / "open.key", std::filesystem::perms::group_read,
                               std::filesystem::perm_options::add);
  EXPECT_SENTENCE(refusal("open.key"));
  for (const std::string& text : {std::string(63, '0'), std::string(62, '0') + "xy", std::string(65, '0')}) {
    write_file(folder / "bad.key", text);
    std::filesystem::permissions(folder / "bad.key", std::filesystem::perms::owner_read);
    EXPECT_SENTENCE(refusal("bad.key"));
    std::filesystem::remove(folder / "bad.key");
  }
}

TEST(NetworkCounts, SayWhyDatagramsWereRefused) {
  NetworkCounts counts{};
  EXPECT_EQ(network_counts_text(counts), "");
  for (std::size_t k = 0; k < kSealRefusals; ++k) counts[k] = static_cast<long>(k) + 1;
  EXPECT_EQ(refused_datagrams(counts), 77);
  EXPECT_SENTENCE(network_counts_text(counts));
}

TEST(NetworkAddress, IsAHostAndAPort) {
  EXPECT_EQ(network_address("192.168.123.10:15100"), (NetworkAddress{0xC0A87B0Au, 15100}));
  EXPECT_EQ(network_address("localhost:0").host, 0x7F000001u);
  for (const char* text : {"", ":", "15100", "127.0.0.1", "127.0.0.1:", ":15100", "127.0.0.1:70000", "127.0.0.1:1x"})
    EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)network_address(text); }));
}

}  // namespace
}  // namespace duet
