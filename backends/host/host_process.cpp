#include "duet/backends/host/host_process.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

#include "duet/core/json.h"
#include "duet/core/require.h"

namespace duet {
namespace {

using std::chrono::milliseconds;

constexpr std::uint32_t kScene = 1, kStep = 2;                   // of duet's frames
constexpr std::uint32_t kReady = 1, kStepped = 2, kRefused = 3;  // of the host's: two answers, and a sentence instead
constexpr std::size_t kLongestText = 65536;                      // [bytes], of a host's JSON or sentence
constexpr int kMostMemory = 65536, kMostContacts = 4096;
constexpr milliseconds kToEnd{500};  // for a host that has closed its connection

int whole_number(const nlohmann::json& ready, const char* key, int most) {
  const nlohmann::json& value = ready.at(key);
  if (!value.is_number_integer() || value < 0 || value > most)
    throw InputError(fmt::format("{}: expected a whole number from 0 to {}, found {}", key, most, dumped(value)));
  return value.get<int>();
}

void expect_text(const nlohmann::json& ready, const char* key, std::string_view expected) {
  if (ready.at(key) != nlohmann::json(expected))
    throw InputError(fmt::format("{}: expected \"{}\", found {}", key, expected, dumped(ready.at(key))));
}

// Throws InputError and nlohmann's exceptions (a key that is not there).
HostFacts facts_of(std::string_view text, const HostProgram& program) {
  const nlohmann::json ready = parse_json(text, "its answer to the scene");
  for (const auto& [key, value] : ready.items()) {
    constexpr std::array kKeys = {"protocol", "engine", "version", "memory", "contacts"};
    if (std::ranges::find(kKeys, key) == kKeys.end()) throw InputError(fmt::format("unknown key '{}'", excerpt(key)));
  }
  expect_text(ready, "protocol", kHostProtocol);
  expect_text(ready, "engine", program.engine);
  if (!program.version.empty()) expect_text(ready, "version", program.version);
  return {.version = ready.at("version").get<std::string>(),
          .memory = whole_number(ready, "memory", kMostMemory),
          .contacts = whole_number(ready, "contacts", kMostContacts)};
}

}  // namespace

HostProcess::HostProcess(const HostProgram& program) : program_(program) {
  std::array<int, 2> ends{-1, -1};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw std::runtime_error(fmt::format("{}: no socket for its host: {}", program.engine, std::strerror(errno)));
  socket_ = ends[0];
  try {
    child_.emplace(program.command, program.folder, "DUET_HOST_FD", ends[1]);
  } catch (...) {
    close(ends[0]);
    close(ends[1]);
    throw;
  }
  close(ends[1]);
}

HostProcess::~HostProcess() {
  if (socket_ >= 0) close(socket_);
}

HostFacts HostProcess::open(const nlohmann::json& scene) {
  set_limit(program_.start);
  const std::string text =
      dumped(nlohmann::json{{"protocol", kHostProtocol}, {"engine", program_.engine}, {"scene", scene}});
  send(kScene, text);
  const std::span<const char> answer = receive(kReady, 1, kLongestText);
  HostFacts facts;
  try {
    facts = facts_of({answer.data(), answer.size()}, program_);
  } catch (const std::exception& error) {
    refuse(fmt::format("its host does not answer the scene as {} has it: {}", kHostProtocol, error.what()));
  }
  set_limit(program_.hang);
  return facts;
}

std::span<const double> HostProcess::step(std::span<const double> request, std::size_t least, std::size_t most) {
  send(kStep, {reinterpret_cast<const char*>(request.data()), request.size_bytes()});
  const std::span<const char> answer = receive(kStepped, sizeof(double) * least, sizeof(double) * most);
  if (answer.size() % sizeof(double) != 0)
    refuse(fmt::format("its host answers a step with {} bytes, which are no whole number of doubles", answer.size()));
  return {answer_.data(), answer.size() / sizeof(double)};
}

bool HostProcess::is_waiting() const {
  char byte = 0;
  return socket_ >= 0 && recv(socket_, &byte, 1, MSG_PEEK | MSG_DONTWAIT) < 0 && (errno == EAGAIN || errno == EINTR);
}

void HostProcess::refuse(const std::string& fault) {
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
  child_->kill();
  throw std::runtime_error(fmt::format("{}: {}", program_.engine, fault));
}

void HostProcess::set_limit(milliseconds limit) {
  limit_ = limit;
  const timeval time{.tv_sec = limit.count() / 1000, .tv_usec = limit.count() % 1000 * 1000};
  setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time);
  setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &time, sizeof time);
}

void HostProcess::lose() {
  const std::optional<std::string> end = child_->ended(kToEnd);
  refuse(end ? fmt::format("its host ended with {} before it answered message {}", *end, number_)
             : fmt::format("its host closed the connection before it answered message {}", number_));
}

void HostProcess::be_late() {
  refuse(fmt::format("its host gave no answer to message {} within {} ms", number_, limit_.count()));
}

void HostProcess::send(std::uint32_t kind, std::span<const char> content) {
  if (socket_ < 0) throw std::runtime_error(fmt::format("{}: its host has ended", program_.engine));
  asked_ = std::chrono::steady_clock::now();
  const Head head{.bytes = static_cast<std::uint32_t>(content.size()), .kind = kind, .number = ++number_};
  const auto write = [this](const char* from, std::size_t bytes) {
    while (bytes > 0) {
      const ssize_t sent = ::send(socket_, from, bytes, MSG_NOSIGNAL);
      if (sent < 0 && errno != EINTR && errno != EAGAIN) lose();
      if (sent < static_cast<ssize_t>(bytes) && std::chrono::steady_clock::now() > asked_ + limit_) be_late();
      if (sent < 0) continue;
      from += sent;
      bytes -= static_cast<std::size_t>(sent);
    }
  };
  write(reinterpret_cast<const char*>(&head), sizeof head);
  write(content.data(), content.size());
}

std::span<const char> HostProcess::receive(std::uint32_t kind, std::size_t least, std::size_t most) {
  Head head;
  read_exactly({reinterpret_cast<char*>(&head), sizeof head});
  if (head.number != number_) refuse(fmt::format("its host answers message {}, expected {}", head.number, number_));
  if (head.kind != kind && head.kind != kRefused)
    refuse(fmt::format("its host answers with a frame of kind {}, expected {} or {}", head.kind, kind, kRefused));
  if (head.kind == kRefused) least = 1, most = kLongestText;
  if (head.bytes < least || head.bytes > most)
    refuse(
        fmt::format("its host answers message {} with {} bytes, expected {} to {}", number_, head.bytes, least, most));
  answer_.resize(std::max(answer_.size(), head.bytes / sizeof(double) + 1));
  const std::span<char> content(reinterpret_cast<char*>(answer_.data()), head.bytes);
  read_exactly(content);
  if (head.kind == kRefused) refuse(excerpt({content.data(), content.size()}, kShownSentence));
  return content;
}

void HostProcess::read_exactly(std::span<char> to) {
  while (!to.empty()) {
    const ssize_t got = recv(socket_, to.data(), to.size(), MSG_WAITALL);
    if (got == 0 || (got < 0 && errno != EINTR && errno != EAGAIN)) lose();
    if (got < static_cast<ssize_t>(to.size()) && std::chrono::steady_clock::now() > asked_ + limit_) be_late();
    if (got > 0) to = to.subspan(static_cast<std::size_t>(got));
  }
}

namespace {

// The one object of the process beside the loaded modules: without it each world would start a runtime of its own.
struct WaitingHosts {
  std::mutex mutex;
  std::vector<std::unique_ptr<HostProcess>> hosts;
};

WaitingHosts& waiting_hosts() {
  static WaitingHosts waiting;
  return waiting;
}

}  // namespace

std::unique_ptr<HostProcess> take_host(const HostProgram& program) {
  WaitingHosts& waiting = waiting_hosts();
  {
    const std::lock_guard lock(waiting.mutex);
    std::erase_if(waiting.hosts, [](const auto& host) { return !host->is_waiting(); });
    const auto found =
        std::ranges::find_if(waiting.hosts, [&](const auto& host) { return host->program() == program; });
    if (found != waiting.hosts.end()) {
      std::unique_ptr<HostProcess> host = std::move(*found);
      waiting.hosts.erase(found);
      return host;
    }
  }
  return std::make_unique<HostProcess>(program);
}

void give_back(std::unique_ptr<HostProcess> host) {
  if (host == nullptr || !host->is_waiting()) return;
  WaitingHosts& waiting = waiting_hosts();
  const std::lock_guard lock(waiting.mutex);
  if (waiting.hosts.size() < std::max(1U, std::thread::hardware_concurrency()))
    waiting.hosts.push_back(std::move(host));
}

}  // namespace duet
