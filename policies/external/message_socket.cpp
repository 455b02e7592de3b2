#include "duet/policies/external/message_socket.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include "duet/core/require.h"

namespace duet {
namespace {

using Result = MessageSocket::Result;

bool would_block(int error) { return error == EAGAIN || error == EWOULDBLOCK; }

bool poll_until(int descriptor, short events, AwakeDeadline& deadline, const std::function<bool()>& stop_asked) {
  constexpr std::chrono::milliseconds kSlice(100);  // between two looks at the clock and questions whether to stop
  while (true) {
    pollfd entry{.fd = descriptor, .events = events, .revents = 0};
    const int count = poll(&entry, 1, static_cast<int>(std::min(deadline.left(), kSlice).count()));
    if (count > 0) return true;
    if (count < 0 && errno != EINTR) return false;
    if (deadline.passed() || (stop_asked && stop_asked())) return false;
  }
}

[[noreturn]] void refuse_connection(const std::string& address, const std::string& reason) {
  throw MissingError(fmt::format("cannot connect to '{}': {}", address, reason));
}

void connect_socket(int descriptor, const sockaddr* name, socklen_t size, const std::string& address,
                    AwakeDeadline& deadline) {
  if (connect(descriptor, name, size) == 0) return;
  if (errno != EINPROGRESS) refuse_connection(address, std::strerror(errno));
  if (!poll_until(descriptor, POLLOUT, deadline, {})) refuse_connection(address, "no answer in time");
  int error = 0;
  socklen_t length = sizeof error;
  getsockopt(descriptor, SOL_SOCKET, SO_ERROR, &error, &length);
  if (error != 0) refuse_connection(address, std::strerror(error));
}

// Closes the descriptor unless it is released.
class OpenSocket {
 public:
  OpenSocket(int family, const std::string& address)
      : descriptor_(socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    if (descriptor_ < 0) refuse_connection(address, std::strerror(errno));
  }
  ~OpenSocket() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  OpenSocket(const OpenSocket&) = delete;
  OpenSocket& operator=(const OpenSocket&) = delete;
  [[nodiscard]] int get() const { return descriptor_; }
  int release() { return std::exchange(descriptor_, -1); }

 private:
  int descriptor_;
};

int connect_local(const std::string& path, AwakeDeadline& deadline) {
  sockaddr_un name{.sun_family = AF_UNIX, .sun_path = {}};
  if (path.size() >= sizeof name.sun_path)
    refuse_connection(path, fmt::format("expected a path of less than {} bytes", sizeof name.sun_path));
  std::ranges::copy(path, std::begin(name.sun_path));
  OpenSocket opened(AF_UNIX, path);
  connect_socket(opened.get(), reinterpret_cast<const sockaddr*>(&name), sizeof name, path, deadline);
  return opened.release();
}

int connect_tcp(const std::string& host, const std::string& port, const std::string& address, AwakeDeadline& deadline) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), port.c_str(), &hints, &found); error != 0)
    refuse_connection(address, gai_strerror(error));
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, freeaddrinfo);
  for (const addrinfo* entry = found;; entry = entry->ai_next) try {
      OpenSocket opened(entry->ai_family, address);
      connect_socket(opened.get(), entry->ai_addr, entry->ai_addrlen, address, deadline);
      const int on = 1;  // a small answer is not to wait for more
      setsockopt(opened.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
      return opened.release();
    } catch (const MissingError&) {
      if (entry->ai_next == nullptr) throw;
    }
}

}  // namespace

MessageSocket::MessageSocket(int descriptor) : descriptor_(descriptor) {
  fcntl(descriptor_, F_SETFL, fcntl(descriptor_, F_GETFL) | O_NONBLOCK);
}

MessageSocket::~MessageSocket() { close(descriptor_); }

Result MessageSocket::wait(short events, AwakeDeadline& deadline) const {
  return poll_until(descriptor_, events, deadline, stop_asked_) ? Result::kDone : Result::kLate;
}

Result MessageSocket::flush(AwakeDeadline& deadline) {
  while (!outgoing_.empty()) {
    const ssize_t sent = ::send(descriptor_, outgoing_.data(), outgoing_.size(), MSG_NOSIGNAL);
    if (sent > 0) {
      outgoing_.erase(0, static_cast<std::size_t>(sent));
    } else if (sent < 0 && would_block(errno)) {
      if (wait(POLLOUT, deadline) == Result::kLate) return Result::kLate;
    } else if (sent == 0 || errno != EINTR) {
      return Result::kClosed;
    }
  }
  return Result::kDone;
}

Result MessageSocket::send(std::string_view message, AwakeDeadline& deadline) {
  if (const Result result = flush(deadline); result != Result::kDone) return result;
  outgoing_ = framed(message);
  return flush(deadline);
}

Result MessageSocket::receive(std::string& message, AwakeDeadline& deadline) {
  std::array<char, 65536> bytes{};
  while (true) {
    if (std::optional<std::string> next = incoming_.next()) {
      message = std::move(*next);
      return Result::kDone;
    }
    const ssize_t count = recv(descriptor_, bytes.data(), bytes.size(), 0);
    if (count > 0) {
      incoming_.append({bytes.data(), static_cast<std::size_t>(count)});
    } else if (count < 0 && would_block(errno)) {
      if (wait(POLLIN, deadline) == Result::kLate) return Result::kLate;
    } else if (count == 0 || errno != EINTR) {
      return Result::kClosed;
    }
  }
}

SocketPair connected_pair() {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw std::runtime_error(fmt::format("cannot make a local socket: {}", std::strerror(errno)));
  return {ends[0], ends[1]};
}

int connect_to(const std::string& address, AwakeDeadline& deadline) {
  const std::size_t colon = address.rfind(':');
  if (address.find('/') != std::string::npos || colon == std::string::npos) return connect_local(address, deadline);
  return connect_tcp(address.substr(0, colon), address.substr(colon + 1), address, deadline);
}

}  // namespace duet
