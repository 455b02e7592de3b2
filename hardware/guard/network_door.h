// The guard's local sockets over a network. NetworkDoor, beside the guard, takes sealed datagrams of planners,
// estimators and trackers, hands what they carry to the guard's local sockets, and sends reports and status to who
// asks. NetworkLink, on another computer, makes the same local sockets there: what talks to a guard on its own computer
// talks to one elsewhere without a change. Neither is part of the guard's tick: what is refused costs the guard
// nothing, what is lost is as if it had not been sent. docs/hardware.md, "Over a network". step() reads no clock; one
// owner, one thread, but for counts().
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "duet/hardware/guard/guard_message.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/sealed_datagram.h"

namespace duet {

// Paths of the sockets of one computer.
struct GuardSockets {
  std::string guard = "duet-guard.socket", person = "duet-person.socket", pose = "duet-pose.socket";
};

class NetworkDoor {
 public:
  // Receives at `socket`, of DatagramSocket::at_address().
  NetworkDoor(DatagramSocket socket, const NetworkKey& key, const GuardSockets& sockets);

  // Handles what waits, at most 256 datagrams. `now`: by one clock that rises [s].
  void step(double now);
  [[nodiscard]] bool wait(double most) const { return socket_.wait(most); }
  // Any thread may ask.
  [[nodiscard]] NetworkCounts counts() const;
  [[nodiscard]] std::uint16_t port() const { return socket_.port(); }

 private:
  // Where reports, or the status, come from for whoever asked last, a second long.
  struct Subscription {
    std::string path;
    SealedKind kind;
    std::optional<DatagramSocket> from = {};
    NetworkAddress to = {};
    std::uint64_t ticket = 0;
    double until = 0.0;
  };
  // Nothing for a hello, which is answered and not counted.
  std::optional<SealRefusal> handle(std::span<const std::byte> datagram, const NetworkAddress& from, double now);
  void answer(const SealedHead& hello, const NetworkAddress& to, double now);
  SealRefusal subscribe(Subscription& subscription, std::span<const std::byte> carried, const NetworkAddress& to,
                        double now);
  void pass_on(Subscription& subscription, double now);
  void send(SealedKind kind, std::uint64_t ticket, std::span<const std::byte> carried, const NetworkAddress& to,
            double now);

  DatagramSocket socket_;
  NetworkKey key_;
  SealGate gate_;
  LocalPeer guard_, person_, pose_;
  Subscription reports_, status_;
  std::uint64_t sequence_ = 0;
  SealedBuffer sent_{};
  std::array<std::byte, kMostSealedBytes + 1> received_{};  // a longer one is seen
  std::array<std::atomic<long>, kSealRefusals> counts_{};
};

// The other computer's end: `sockets` are made there.
class NetworkLink {
 public:
  // `socket`, of DatagramSocket::to_address(): to the door. `sender`: 0 to 15, another for each link to one door.
  // Throws as DatagramSocket::at_path does.
  NetworkLink(DatagramSocket socket, const NetworkKey& key, const GuardSockets& sockets, std::uint16_t sender);

  void step(double now);
  [[nodiscard]] bool wait(double most) const { return socket_.wait(most); }
  // Since the door last answered; larger than kTicketLife: it does not, and nothing is sent [s].
  [[nodiscard]] double silence(double now) const { return now - answered_at_; }
  [[nodiscard]] long sent() const { return datagrams_; }
  [[nodiscard]] long received() const { return received_; }  // reports and status

 private:
  void ask(double now);
  void take(double now);
  void pass_on(DatagramSocket& from, SealedKind kind, double now);
  void send(SealedKind kind, std::uint64_t ticket, std::span<const std::byte> carried, double now);

  DatagramSocket socket_;
  NetworkKey key_;
  std::uint16_t sender_;
  DatagramSocket guard_, person_, pose_;
  LocalPeer reports_, status_;
  std::uint64_t nonce_, hello_, answered_, ticket_ = 0, sequence_ = 0, from_guard_ = 0;
  double answered_at_ = -1e9, asked_at_ = -1e9, clock_ = -1e9;
  long datagrams_ = 0, received_ = 0;
  SealedBuffer buffer_{};
};

// A door that opens by itself, until it goes out of scope. Made before the guard asks for real-time priority, it has
// none.
class OpenDoor {
 public:
  // Throws as DatagramSocket::at_address() does.
  OpenDoor(const NetworkAddress& address, const NetworkKey& key, const GuardSockets& sockets);
  ~OpenDoor();
  OpenDoor(const OpenDoor&) = delete;
  OpenDoor& operator=(const OpenDoor&) = delete;
  [[nodiscard]] NetworkCounts counts() const { return door_.counts(); }

 private:
  NetworkDoor door_;
  std::atomic<bool> ends_ = false;
  std::thread thread_;
};

}  // namespace duet
