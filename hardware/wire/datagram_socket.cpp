#include "duet/hardware/wire/datagram_socket.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace duet {
namespace {

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error(fmt::format("{}: {}", what, std::strerror(errno)));
}

int make_socket(int family) {
  const int descriptor = socket(family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (descriptor < 0) fail("cannot make a socket");
  return descriptor;
}

sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof(address.sun_path))
    throw std::runtime_error(fmt::format("socket '{}': expected a path of 1 to {} characters, found {}", path,
                                         sizeof(address.sun_path) - 1, path.size()));
  std::memcpy(address.sun_path, path.c_str(), path.size());
  return address;
}

sockaddr_in address_of(const NetworkAddress& place) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(place.host);
  address.sin_port = htons(place.port);
  return address;
}

sockaddr_in loopback(std::uint16_t port) { return address_of(NetworkAddress{INADDR_LOOPBACK, port}); }

std::string text_of(const NetworkAddress& place) {
  return fmt::format("{}.{}.{}.{}:{}", place.host >> 24, place.host >> 16 & 255, place.host >> 8 & 255,
                     place.host & 255, place.port);
}

// A tenth of a second of a full network, as far as the system allows it.
constexpr int kQueueBytes = 4 << 20;

template <typename Address>
const sockaddr* generic(const Address& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

bool somebody_receives(const sockaddr_un& address) {
  const int probe = make_socket(AF_UNIX);
  const bool answered = connect(probe, generic(address), sizeof(address)) == 0;
  close(probe);
  return answered;
}

template <typename Address>
int connected(int family, const Address& address, const std::string& refusal) {
  const int descriptor = make_socket(family);
  if (connect(descriptor, generic(address), sizeof(address)) == 0) return descriptor;
  const int why = errno;
  close(descriptor);
  errno = why;
  fail(refusal);
}

}  // namespace

DatagramSocket DatagramSocket::at_path(const std::string& path) {
  const sockaddr_un address = address_of(path);
  if (somebody_receives(address))
    throw std::runtime_error(fmt::format("socket '{}': another process receives there", path));
  unlink(path.c_str());
  DatagramSocket made(make_socket(AF_UNIX));
  const mode_t before = umask(0177);  // for its owner only
  const int bound = bind(made.descriptor_, generic(address), sizeof(address));
  umask(before);
  if (bound != 0) fail(fmt::format("cannot receive at '{}'", path));
  made.path_ = path;
  return made;
}

DatagramSocket DatagramSocket::to_path(const std::string& path) {
  return DatagramSocket(connected(AF_UNIX, address_of(path), fmt::format("nobody receives at '{}'", path)));
}

DatagramSocket DatagramSocket::at_port(std::uint16_t port) {
  const sockaddr_in address = loopback(port);
  DatagramSocket made(make_socket(AF_INET));
  if (bind(made.descriptor_, generic(address), sizeof(address)) != 0)
    fail(fmt::format("cannot receive at port {} of 127.0.0.1", port));
  return made;
}

DatagramSocket DatagramSocket::to_port(std::uint16_t port) {
  return DatagramSocket(connected(AF_INET, loopback(port), fmt::format("cannot send to port {} of 127.0.0.1", port)));
}

NetworkAddress network_address(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  const std::string host = text.substr(0, colon == std::string::npos ? 0 : colon);
  NetworkAddress address;
  const char* end = text.data() + text.size();
  const char* begin = colon == std::string::npos ? end : text.data() + colon + 1;
  const auto [stop, error] = std::from_chars(begin, end, address.port);
  if (host.empty() || begin == end || stop != end || error != std::errc())
    throw std::invalid_argument(fmt::format("expected HOST:PORT, the port up to 65535, found '{}'", text));
  addrinfo asked{};
  asked.ai_family = AF_INET;
  asked.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (const int code = getaddrinfo(host.c_str(), nullptr, &asked, &found); code != 0)
    throw std::invalid_argument(fmt::format("no IPv4 address of '{}' is known: {}", host, gai_strerror(code)));
  sockaddr_in first{};
  std::memcpy(&first, found->ai_addr, sizeof(first));
  freeaddrinfo(found);
  address.host = ntohl(first.sin_addr.s_addr);
  return address;
}

DatagramSocket DatagramSocket::at_address(const NetworkAddress& address) {
  DatagramSocket made(make_socket(AF_INET));
  const sockaddr_in place = address_of(address);
  if (bind(made.descriptor_, generic(place), sizeof(place)) != 0)
    fail(fmt::format("cannot receive at {}", text_of(address)));
  (void)setsockopt(made.descriptor_, SOL_SOCKET, SO_RCVBUF, &kQueueBytes, sizeof(kQueueBytes));
  return made;
}

DatagramSocket DatagramSocket::to_address(const NetworkAddress& address) {
  return DatagramSocket(connected(AF_INET, address_of(address), fmt::format("cannot send to {}", text_of(address))));
}

std::size_t DatagramSocket::receive_from(std::span<std::byte> buffer, NetworkAddress& from) {
  sockaddr_in address{};
  socklen_t size = sizeof(address);
  const ssize_t length =
      recvfrom(descriptor_, buffer.data(), buffer.size(), 0, reinterpret_cast<sockaddr*>(&address), &size);
  if (length <= 0) return 0;
  from = {ntohl(address.sin_addr.s_addr), ntohs(address.sin_port)};
  return static_cast<std::size_t>(length);
}

bool DatagramSocket::send_to(const NetworkAddress& address, std::span<const std::byte> datagram) {
  const sockaddr_in place = address_of(address);
  return sendto(descriptor_, datagram.data(), datagram.size(), MSG_NOSIGNAL, generic(place), sizeof(place)) ==
         static_cast<ssize_t>(datagram.size());
}

bool LocalPeer::is_there(double now) {
  constexpr double kLookEvery = 0.1;  // [s]
  if (to_ || now < looks_at_) return to_.has_value();
  looks_at_ = now + kLookEvery;
  try {
    to_.emplace(DatagramSocket::to_path(path_));
  } catch (const std::runtime_error&) {  // nobody is
  }
  return to_.has_value();
}

bool LocalPeer::send(std::span<const std::byte> datagram, double now) {
  if (!is_there(now)) return false;
  if (to_->send(datagram)) return true;
  to_.reset();  // gone, or so busy that its queue is full
  return false;
}

DatagramSocket::DatagramSocket(DatagramSocket&& other) noexcept
    : descriptor_(other.descriptor_), path_(std::move(other.path_)) {
  other.descriptor_ = -1;
  other.path_.clear();
}

DatagramSocket::~DatagramSocket() {
  if (descriptor_ >= 0) close(descriptor_);
  if (!path_.empty()) unlink(path_.c_str());
}

bool DatagramSocket::send(std::span<const std::byte> datagram) {
  return ::send(descriptor_, datagram.data(), datagram.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(datagram.size());
}

std::size_t DatagramSocket::receive(std::span<std::byte> buffer) {
  const ssize_t length = recv(descriptor_, buffer.data(), buffer.size(), 0);
  return length > 0 ? static_cast<std::size_t>(length) : 0;
}

bool DatagramSocket::wait(double most) const {
  pollfd asked{.fd = descriptor_, .events = POLLIN, .revents = 0};
  return poll(&asked, 1, static_cast<int>(std::ceil(1.0e3 * most))) > 0;
}

std::uint16_t DatagramSocket::port() const {
  sockaddr_in address{};
  socklen_t length = sizeof(address);
  if (getsockname(descriptor_, reinterpret_cast<sockaddr*>(&address), &length) != 0) fail("cannot see a socket's port");
  return ntohs(address.sin_port);
}

}  // namespace duet
