#include "duet/policies/external/message.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
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
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "duet/core/json.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/policies/external/channel_values.h"

namespace duet {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kLengthBytes = 4;
constexpr std::size_t kExcerpt = 40;  // of a value, in our message
constexpr const char* kMessage = "message of the policy";

[[noreturn]] void refuse(const std::string& message) { throw InputError(fmt::format("{}: {}", kMessage, message)); }

std::string clipped(std::string_view text) { return excerpt(text, kExcerpt); }

Json parse_text(std::string_view text) {
  try {
    return parse_json(text, kMessage);
  } catch (const InputError&) {
    for (const char* word : {"NaN", "Infinity"})
      if (text.find(word) != std::string_view::npos) refuse(fmt::format("expected finite numbers, found {}", word));
    throw;
  }
}

const Json& member(const Json& json, const char* key) {
  const auto it = json.find(key);
  if (it == json.end()) refuse(fmt::format("expected the key '{}', found none", key));
  return *it;
}

int whole_number(const Json& json, const char* key) {
  const Json& value = member(json, key);
  if (!value.is_number_integer() || value < 0 || value > 1000000000)
    refuse(fmt::format("'{}': expected a whole number, found {}", key, clipped(dumped(value))));
  return value.get<int>();
}

void refuse_other_keys(const Json& json, const std::vector<std::string>& known) {
  for (const auto& [key, value] : json.items())
    if (std::ranges::find(known, key) == known.end()) refuse(unknown_name_message("key", clipped(key), known));
}

PolicyMessage parse_hello(const Json& json) {
  refuse_other_keys(json, {"type", "version", "joints"});
  PolicyMessage message;
  message.type = PolicyMessage::Type::kHello;
  message.version = whole_number(json, "version");
  if (!json.contains("joints")) return message;
  const Json& joints = json["joints"];
  if (!joints.is_array() || !std::ranges::all_of(joints, [](const Json& name) { return name.is_string(); }))
    refuse(fmt::format("'joints': expected a list of names, found {}", joints.type_name()));
  message.joints = joints.get<std::vector<std::string>>();
  return message;
}

void append_anchor(const Json& anchor, PolicyMessage& message) {
  if (!anchor.is_array()) refuse(fmt::format("'anchors': expected lists of numbers, found {}", anchor.type_name()));
  for (const Json& number : anchor) {
    if (!number.is_number())
      refuse(fmt::format("'anchors': anchor {}: expected numbers, found {}", message.anchors, number.type_name()));
    message.numbers.push_back(static_cast<float>(number.get<double>()));
  }
  ++message.anchors;
  if (message.numbers.size() != anchor.size() * static_cast<std::size_t>(message.anchors))
    refuse(fmt::format("'anchors': anchor {}: expected as many numbers as before, found {}", message.anchors - 1,
                       anchor.size()));
}

PolicyMessage parse_plan(const Json& json) {
  refuse_other_keys(json, {"type", "tick", "anchors"});
  PolicyMessage message;
  message.type = PolicyMessage::Type::kPlan;
  message.tick = whole_number(json, "tick");
  const Json& anchors = member(json, "anchors");
  if (!anchors.is_array()) refuse(fmt::format("'anchors': expected a list of anchors, found {}", anchors.type_name()));
  for (const Json& anchor : anchors) append_anchor(anchor, message);
  return message;
}

Json channels_json(int joints) {
  Json channels = Json::array();
  int first = 0;
  for (const Channel& channel : frame_channels()) {
    const int size = channel_size(channel, {.joints = joints, .actions = 0});
    channels.push_back(
        {{"name", channel_name(channel.kind, ChannelFormat::kPolicy)}, {"first", first}, {"size", size}});
    first += size;
  }
  return channels;
}

std::vector<double> joint_values(const RobotModel& robot, const std::vector<std::string>& joints,
                                 const Eigen::VectorXd& values) {
  std::vector<double> picked;
  picked.reserve(joints.size());
  for (const std::string& name : joints) picked.push_back(values[robot.joint_index(name)]);
  return picked;
}

}  // namespace

PolicyMessage parse_policy_message(std::string_view text) {
  const Json json = parse_text(text);
  if (!json.is_object()) refuse(fmt::format("expected an object, found {}", json.type_name()));
  const Json& type = member(json, "type");
  if (!type.is_string()) refuse(fmt::format("'type': expected a name, found {}", type.type_name()));
  const std::string name = type.get<std::string>();
  if (name == "hello") return parse_hello(json);
  if (name == "plan") return parse_plan(json);
  const std::vector<std::string> known = {"hello", "ready", "plan"};
  if (name != "ready") refuse(unknown_name_message("type", clipped(name), known));
  refuse_other_keys(json, {"type"});
  return {};
}

std::string_view to_string(PolicyMessage::Type type) {
  switch (type) {
    case PolicyMessage::Type::kHello:
      return "hello";
    case PolicyMessage::Type::kReady:
      return "ready";
    case PolicyMessage::Type::kPlan:
      return "plan";
  }
  return "";
}

std::string hello_message(const PolicyDescriptor& descriptor, const RobotModel& robot,
                          const std::vector<std::string>& joints) {
  const PlanFormat& output = descriptor.output;
  const Json json = {{"type", "hello"},
                     {"version", kPolicyMessageVersion},
                     {"policy", descriptor.name},
                     {"robot", robot.name},
                     {"joints", joints},
                     {"neutral", joint_values(robot, joints, robot.neutral)},
                     {"lower", joint_values(robot, joints, robot.lower())},
                     {"upper", joint_values(robot, joints, robot.upper())},
                     {"rate_hz", 50},
                     {"ticks_per_plan", kTicksPerPlan},
                     {"frames", kHistoryFrames},
                     {"frame_of_reference", to_string(descriptor.frame)},
                     {"channels", channels_json(static_cast<int>(joints.size()))},
                     {"tasks", task_names(descriptor.tasks)},
                     {"anchors", output.anchors},
                     {"ticks_per_anchor", output.ticks_per_anchor},
                     {"anchor_size", kPlanNumbersBeforeJoints + static_cast<int>(joints.size())},
                     {"anchor_frame", to_string(output.frame)},
                     {"deadline_ms", descriptor.deadline_ms > 0 ? Json(descriptor.deadline_ms) : Json()}};
  return dumped(json);
}

std::string reset_message(const EpisodeContext& context) {
  const Pose& start = context.start.X_WB;
  const Json json = {
      {"type", "reset"},
      {"task", to_string(context.task)},
      {"prompt", context.prompt},
      {"seed", context.seed},
      {"start", {start.p.x(), start.p.y(), start.p.z(), start.R.w(), start.R.x(), start.R.y(), start.R.z()}}};
  return dumped(json);  // a prompt need not be UTF-8
}

// Written by hand: the shortest decimals of a float are half as long as those of the same double.
std::string observe_message(int tick, const std::vector<float>& numbers, int frames) {
  const std::size_t size = numbers.size() / static_cast<std::size_t>(frames);
  fmt::memory_buffer text;
  fmt::format_to(std::back_inserter(text), R"({{"type":"observe","tick":{},"frames":[)", tick);
  for (std::size_t i = 0; i < static_cast<std::size_t>(frames); ++i) {
    const auto row = std::span(numbers).subspan(i * size, size);
    fmt::format_to(std::back_inserter(text), "{}[{}]", i == 0 ? "" : ",", fmt::join(row, ","));
  }
  fmt::format_to(std::back_inserter(text), "]}}");
  return fmt::to_string(text);
}

std::string bye_message() { return R"({"type":"bye"})"; }

std::string framed(std::string_view message) {
  std::string bytes;
  bytes.reserve(kLengthBytes + message.size());
  for (std::size_t i = 0; i < kLengthBytes; ++i)
    bytes += static_cast<char>(static_cast<unsigned char>(message.size() >> (8 * i)));
  return bytes.append(message);
}

std::optional<std::string> MessageBuffer::next() {
  if (bytes_.size() < kLengthBytes) return std::nullopt;
  std::size_t length = 0;
  for (std::size_t i = 0; i < kLengthBytes; ++i)
    length |= static_cast<std::size_t>(static_cast<unsigned char>(bytes_[i])) << (8 * i);
  if (length > kLargestPolicyMessage)
    refuse(fmt::format("expected at most {} bytes, found a length of {}", kLargestPolicyMessage, length));
  if (bytes_.size() < kLengthBytes + length) return std::nullopt;
  std::string message = bytes_.substr(kLengthBytes, length);
  bytes_.erase(0, kLengthBytes + length);
  return message;
}

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
