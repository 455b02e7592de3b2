#include "duet/hardware/lcm_channel.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace duet {
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
