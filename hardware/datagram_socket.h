// Datagrams between processes of one machine: a Unix socket at a path that only its owner may use, or UDP on the
// loopback address. Nothing blocks but wait(). One owner, one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace duet {

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
  ~DatagramSocket();
  DatagramSocket(DatagramSocket&& other) noexcept;
  DatagramSocket& operator=(DatagramSocket&& other) = delete;

  // False where it was not sent.
  bool send(std::span<const std::byte> datagram);
  // Its length, 0 where none waits. A longer one than `buffer` is cut.
  std::size_t receive(std::span<std::byte> buffer);
  // Until a datagram waits, so many seconds at most; false where none does.
  [[nodiscard]] bool wait(double most) const;
  [[nodiscard]] std::uint16_t port() const;  // of at_port

 private:
  explicit DatagramSocket(int descriptor, std::string path = "") : descriptor_(descriptor), path_(std::move(path)) {}

  int descriptor_ = -1;
  std::string path_;  // that is removed with it
};

}  // namespace duet
