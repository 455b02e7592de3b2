#include "duet/hardware/wire/datagram_socket.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
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

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  return address;
}

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
