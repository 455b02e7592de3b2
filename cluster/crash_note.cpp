#include "duet/cluster/crash_note.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <utility>
#include <vector>

namespace duet {
namespace {

constexpr std::size_t kKeyBytes = 64;
constexpr std::array<std::pair<int, const char*>, 5> kCrashes = {
    {{SIGSEGV, "SIGSEGV"}, {SIGBUS, "SIGBUS"}, {SIGFPE, "SIGFPE"}, {SIGILL, "SIGILL"}, {SIGABRT, "SIGABRT"}}};

std::atomic<int> note_descriptor{-1};
thread_local std::array<char, kKeyBytes> key_of_thread{};  // zero bytes: at none

const char* name_of_crash(int signal) {
  for (const auto& [number, name] : kCrashes)
    if (number == signal) return name;
  return "signal";
}

// Only what POSIX allows in a handler: write and raise. A line of its own, whatever was half-written before it.
void on_crash(int signal) {
  const int descriptor = note_descriptor.exchange(-1);
  if (descriptor >= 0 && key_of_thread[0] != '\0') {
    std::array<char, kKeyBytes + 32> line{};
    char* end = std::copy_n("\ncrashed ", 9, line.begin());
    end = std::copy_if(key_of_thread.begin(), key_of_thread.end(), end, [](char c) { return c != '\0'; });
    *end++ = ' ';
    const char* name = name_of_crash(signal);
    end = std::copy_n(name, std::strlen(name), end);
    *end++ = '\n';
    static_cast<void>(!::write(descriptor, line.data(), static_cast<std::size_t>(end - line.data())));
  }
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

// A stack for the handler, once a thread.
class HandlerStack {
 public:
  HandlerStack() : bytes_(std::size_t{64} << 10) {
    const stack_t stack = {.ss_sp = bytes_.data(), .ss_flags = 0, .ss_size = bytes_.size()};
    ::sigaltstack(&stack, nullptr);
  }
  ~HandlerStack() {
    const stack_t none = {.ss_sp = nullptr, .ss_flags = SS_DISABLE, .ss_size = 0};
    ::sigaltstack(&none, nullptr);
  }
  HandlerStack(const HandlerStack&) = delete;
  HandlerStack& operator=(const HandlerStack&) = delete;
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }

 private:
  std::vector<char> bytes_;
};

}  // namespace

void note_crashes_in(int descriptor) {
  note_descriptor = descriptor;
  struct sigaction action {};
  action.sa_handler = descriptor >= 0 ? on_crash : SIG_DFL;
  action.sa_flags = SA_ONSTACK;
  ::sigemptyset(&action.sa_mask);
  for (const auto& [signal, name] : kCrashes) ::sigaction(signal, &action, nullptr);
}

CrashScope::CrashScope(std::string_view key) {
  thread_local const HandlerStack stack;
  static_cast<void>(stack.size());  // made now
  key_of_thread.fill('\0');
  std::copy_n(key.begin(), std::min(key.size(), kKeyBytes), key_of_thread.begin());
}

CrashScope::~CrashScope() { key_of_thread.fill('\0'); }

}  // namespace duet
