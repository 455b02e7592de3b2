#include "duet/hardware/guard/network_door.h"

#include <algorithm>
#include <cstring>

#include "duet/core/machine.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr int kMostAtOnce = 256;     // datagrams of one step: who sends more does not stop reports
constexpr double kAskedFor = 1.0;    // [s]
constexpr double kAskEvery = 0.1;    // hellos and what is asked for [s]
constexpr double kDoorWait = 0.002;  // for what came at local sockets [s]
constexpr double kMicrosecond = 1e-6;

std::span<const std::byte> bytes_of(const std::uint64_t& number) { return std::as_bytes(std::span(&number, 1)); }

bool read_number(std::span<const std::byte> bytes, std::uint64_t& number) {
  if (bytes.size() < sizeof(number)) return false;
  std::memcpy(&number, bytes.data(), sizeof(number));
  return true;
}

bool is_for_the_guard(SealedKind kind) {
  switch (kind) {
    case SealedKind::kHello:
    case SealedKind::kGuard:
    case SealedKind::kPerson:
    case SealedKind::kPose:
    case SealedKind::kAskReports:
    case SealedKind::kAskStatus:
      return true;
    default:
      return false;
  }
}

}  // namespace

NetworkDoor::NetworkDoor(DatagramSocket socket, const NetworkKey& key, const GuardSockets& sockets)
    : socket_(std::move(socket)),
      key_(key),
      gate_(random_number()),
      guard_(sockets.guard),
      person_(sockets.person),
      pose_(sockets.pose),
      reports_{report_path(sockets.guard), SealedKind::kReport},
      status_{status_path(sockets.guard), SealedKind::kStatus} {}

void NetworkDoor::step(double now) {
  NetworkAddress from;
  for (int k = 0; k < kMostAtOnce; ++k) {
    const std::size_t size = socket_.receive_from(received_, from);
    if (size == 0) break;
    const std::optional<SealRefusal> refusal = handle(std::span<const std::byte>(received_).first(size), from, now);
    if (refusal) counts_[static_cast<std::size_t>(*refusal)].fetch_add(1, std::memory_order_relaxed);
  }
  pass_on(reports_, now);
  pass_on(status_, now);
}

NetworkCounts NetworkDoor::counts() const {
  NetworkCounts counts{};
  for (std::size_t k = 0; k < kSealRefusals; ++k) counts[k] = counts_[k].load(std::memory_order_relaxed);
  return counts;
}

std::optional<SealRefusal> NetworkDoor::handle(std::span<const std::byte> datagram, const NetworkAddress& from,
                                               double now) {
  SealedHead head;
  std::span<const std::byte> carried;
  if (const SealRefusal refusal = unseal(key_, datagram, head, carried); refusal != SealRefusal::kNone) return refusal;
  if (!is_for_the_guard(head.kind)) return SealRefusal::kKind;
  if (head.sender >= kMostSenders) return SealRefusal::kSender;
  if (head.kind == SealedKind::kHello) {  // asks for a ticket, which moves nothing; a repeated one may have it, too
    answer(head, from, now);
    return std::nullopt;
  }
  if (const SealRefusal refusal = gate_.takes(head, now); refusal != SealRefusal::kNone) return refusal;
  if (head.kind == SealedKind::kAskReports) return subscribe(reports_, carried, from, now);
  if (head.kind == SealedKind::kAskStatus) return subscribe(status_, carried, from, now);
  LocalPeer& peer = head.kind == SealedKind::kGuard ? guard_ : head.kind == SealedKind::kPerson ? person_ : pose_;
  return peer.send(carried, now) ? SealRefusal::kNone : SealRefusal::kUnwanted;
}

void NetworkDoor::answer(const SealedHead& hello, const NetworkAddress& to, double now) {
  const std::uint64_t numbers[2] = {hello.sequence, gate_.largest(hello.sender)};
  send(SealedKind::kTicket, gate_.ticket(now), std::as_bytes(std::span(numbers)), to, now);
}

SealRefusal NetworkDoor::subscribe(Subscription& subscription, std::span<const std::byte> carried,
                                   const NetworkAddress& to, double now) {
  if (!read_number(carried, subscription.ticket)) return SealRefusal::kShort;
  subscription.to = to;
  subscription.until = now + kAskedFor;
  return SealRefusal::kNone;
}

// Takes the place of a planner beside the guard, or of `duet hw status`, while somebody elsewhere asks.
void NetworkDoor::pass_on(Subscription& subscription, double now) {
  if (now > subscription.until) {
    subscription.from.reset();
    return;
  }
  if (!subscription.from) {
    try {
      subscription.from.emplace(DatagramSocket::at_path(subscription.path));
    } catch (const std::runtime_error&) {  // somebody on this computer has it
      return;
    }
  }
  std::array<std::byte, kMostSealed> buffer;
  while (const std::size_t size = subscription.from->receive(buffer))
    send(subscription.kind, subscription.ticket, std::span<const std::byte>(buffer).first(size), subscription.to, now);
}

void NetworkDoor::send(SealedKind kind, std::uint64_t ticket, std::span<const std::byte> carried,
                       const NetworkAddress& to, double now) {
  const std::size_t size = seal(key_, {kind, 0, ticket, ++sequence_, now}, carried, sent_);
  (void)socket_.send_to(to, std::span<const std::byte>(sent_).first(size));
}

NetworkLink::NetworkLink(DatagramSocket socket, const NetworkKey& key, const GuardSockets& sockets,
                         std::uint16_t sender)
    : socket_(std::move(socket)),
      key_(key),
      sender_(sender),
      guard_(DatagramSocket::at_path(sockets.guard)),
      person_(DatagramSocket::at_path(sockets.person)),
      pose_(DatagramSocket::at_path(sockets.pose)),
      reports_(report_path(sockets.guard)),
      status_(status_path(sockets.guard)),
      nonce_(random_number()),
      hello_(random_number()),
      answered_(hello_) {
  require(sender < kMostSenders, "a sender's number: expected 0 to {}, found {}", kMostSenders - 1, sender);
}

void NetworkLink::step(double now) {
  take(now);
  if (now - asked_at_ >= kAskEvery) ask(now);
  pass_on(guard_, SealedKind::kGuard, now);
  pass_on(person_, SealedKind::kPerson, now);
  pass_on(pose_, SealedKind::kPose, now);
}

void NetworkLink::ask(double now) {
  asked_at_ = now;
  const std::size_t size = seal(key_, {SealedKind::kHello, sender_, 0, ++hello_, now}, {}, buffer_);
  (void)socket_.send(std::span<const std::byte>(buffer_).first(size));
  if (reports_.is_there(now)) send(SealedKind::kAskReports, ticket_, bytes_of(nonce_), now);
  if (status_.is_there(now)) send(SealedKind::kAskStatus, ticket_, bytes_of(nonce_), now);
}

void NetworkLink::take(double now) {
  std::array<std::byte, kMostSealedBytes> buffer;
  for (int k = 0; k < kMostAtOnce; ++k) {
    const std::size_t size = socket_.receive(buffer);
    if (size == 0) return;
    SealedHead head;
    std::span<const std::byte> carried;
    if (unseal(key_, std::span<const std::byte>(buffer).first(size), head, carried) != SealRefusal::kNone) continue;
    std::uint64_t echo = 0, largest = 0;
    if (head.kind == SealedKind::kTicket) {
      // It has to answer a hello of this run that was not answered yet: what was recorded before answers none.
      if (!read_number(carried, echo) || !read_number(carried.subspan(sizeof(echo)), largest)) continue;
      if (echo <= answered_ || echo > hello_) continue;
      answered_ = echo;
      answered_at_ = now;
      ticket_ = head.ticket;
      sequence_ = std::max(sequence_, largest);
    } else if (head.kind == SealedKind::kReport || head.kind == SealedKind::kStatus) {
      if (head.ticket != nonce_ || head.sequence <= from_guard_) continue;
      from_guard_ = head.sequence;
      ++received_;
      (void)(head.kind == SealedKind::kReport ? reports_ : status_).send(carried, now);
    }
  }
}

// While the door does not answer, messages go nowhere: they would be old.
void NetworkLink::pass_on(DatagramSocket& from, SealedKind kind, double now) {
  std::array<std::byte, kMostSealed> buffer;
  for (int k = 0; k < kMostAtOnce; ++k) {
    const std::size_t size = from.receive(buffer);
    if (size == 0) return;
    if (silence(now) <= kTicketLife) send(kind, ticket_, std::span<const std::byte>(buffer).first(size), now);
  }
}

void NetworkLink::send(SealedKind kind, std::uint64_t ticket, std::span<const std::byte> carried, double now) {
  clock_ = std::max(now, clock_ + kMicrosecond);  // two of one step have two times
  const std::size_t size = seal(key_, {kind, sender_, ticket, ++sequence_, clock_}, carried, buffer_);
  if (socket_.send(std::span<const std::byte>(buffer_).first(size))) ++datagrams_;
}

OpenDoor::OpenDoor(const NetworkAddress& address, const NetworkKey& key, const GuardSockets& sockets)
    : door_(DatagramSocket::at_address(address), key, sockets), thread_([this] {
        while (!ends_) {
          (void)door_.wait(kDoorWait);
          door_.step(monotonic_seconds());
        }
      }) {}

OpenDoor::~OpenDoor() {
  ends_ = true;
  thread_.join();
}

}  // namespace duet
