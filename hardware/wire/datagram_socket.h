// Datagrams between processes of one machine: a Unix socket at a path that only its owner may use, or UDP on the
// loopback address; and UDP between machines, which carries nothing that is not sealed (hardware/wire/
// sealed_datagram.h). Nothing blocks but wait(). One owner, one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace duet {

// An IPv4 address and a port, both in the host's byte order.
struct NetworkAddress {
  std::uint32_t host = 0;
  std::uint16_t port = 0;
  bool operator==(const NetworkAddress&) const = default;
};
// Reads "HOST:PORT"; a host's name is looked up. Throws std::invalid_argument.
NetworkAddress network_address(const std::string& text);

class DatagramSocket {
 public:
  // Receives at `path`, which is made anew; throws std::runtime_error where it cannot be, or where somebody receives
  // there.
  static DatagramSocket at_path(const std::string& path);
  // Sends to `path`; throws std::runtime_error where nobody receives there.
  static DatagramSocket to_path(const std::string& path);
  // Receives at a UDP port of 127.0.0.1 (0: any that is free); sends to one.
  static DatagramSocket at_port(std::uint16_t port);
  static DatagramSocket to_port(std::uint16_t port);
  // Receives at a UDP address of this machine, whoever sends; sends to one, and receives what comes from there.
  static DatagramSocket at_address(const NetworkAddress& address);
  static DatagramSocket to_address(const NetworkAddress& address);
  ~DatagramSocket();
  DatagramSocket(DatagramSocket&& other) noexcept;
  DatagramSocket& operator=(DatagramSocket&& other) = delete;

  // False where it was not sent.
  bool send(std::span<const std::byte> datagram);
  // Its length, 0 where none waits. A longer one than `buffer` is cut.
  std::size_t receive(std::span<std::byte> buffer);
  // The same of at_address, which knows where it came from, and answers there.
  std::size_t receive_from(std::span<std::byte> buffer, NetworkAddress& from);
  bool send_to(const NetworkAddress& address, std::span<const std::byte> datagram);
  // Until a datagram waits, so many seconds at most; false where none does.
  [[nodiscard]] bool wait(double most) const;
  [[nodiscard]] std::uint16_t port() const;  // of at_port

 private:
  explicit DatagramSocket(int descriptor, std::string path = "") : descriptor_(descriptor), path_(std::move(path)) {}

  int descriptor_ = -1;
  std::string path_;  // that is removed with it
};

// The receivers at a path, now or later: looks for them again ten times a second while nobody does.
class LocalPeer {
 public:
  explicit LocalPeer(std::string path) : path_(std::move(path)) {}
  // `now`: by any clock [s]. False where nobody takes it, or their queue is full.
  bool send(std::span<const std::byte> datagram, double now);
  // Whether somebody was there when it last looked; looks again as send() does.
  bool is_there(double now);

 private:
  std::string path_;
  std::optional<DatagramSocket> to_;
  double looks_at_ = 0.0;
};

// The one rule for the sequence numbers of what comes over a socket, be it a planner, a tracker or who estimates the
// person: a number that does not rise is old, and its message dropped. A program that was started anew counts from a
// low number again: after a pause its stream is taken again at the second of two numbers that rise. One number that
// is repeated for ever is no such stream: whoever hangs is not heard. One owner.

inline constexpr double kStreamPause = 1.0;  // since a message was taken [s]; longer than any stream here may be silent

class StreamOrder {
 public:
  // Whether the message with this number, received at `now` [s], is to be taken.
  bool takes(std::uint64_t sequence, double now) {
    if (last_ && sequence <= *last_) {
      const bool paused = now - taken_at_ > kStreamPause, rises = old_one_ && sequence > *old_one_;
      old_one_ = sequence;
      if (!paused || !rises) {
        ++old_;
        return false;
      }
      ++restarts_;
    }
    last_ = sequence;
    taken_at_ = now;
    old_one_.reset();
    return true;
  }
  [[nodiscard]] long old() const { return old_; }            // dropped
  [[nodiscard]] long restarts() const { return restarts_; }  // streams that were taken again

 private:
  std::optional<std::uint64_t> last_, old_one_;  // `old_one_`: the last that was not taken, since one was
  double taken_at_ = 0.0;
  long old_ = 0, restarts_ = 0;
};

}  // namespace duet
