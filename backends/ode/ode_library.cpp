#include "duet/backends/ode/ode_library.h"

#include <fmt/format.h>
#include <ode/ode.h>

#include <array>
#include <cstdarg>
#include <cstdio>
#include <stdexcept>

namespace duet {
namespace {

// ODE ends the process where a handler of errors returns; it is C++ inside and lets exceptions pass.
[[noreturn]] void throw_error(int number, const char* format, va_list arguments) {
  std::array<char, 500> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  throw std::runtime_error(fmt::format("ode: {} (error {})", text.data(), number));
}

void say_nothing(int, const char*, va_list) {}

struct Library {
  Library() {
    if (dInitODE2(0) == 0) throw std::runtime_error("ode: the library cannot be initialised");
    if (dCheckConfiguration("ODE_double_precision") == 0)
      throw std::runtime_error("ode: the library was built with single precision, expected double");
    if (dGetErrorHandler() == nullptr) dSetErrorHandler(throw_error);
    if (dGetDebugHandler() == nullptr) dSetDebugHandler(throw_error);
    if (dGetMessageHandler() == nullptr) dSetMessageHandler(say_nothing);
  }
};

struct ThreadData {
  ThreadData() {
    if (dAllocateODEDataForThread(dAllocateMaskAll) == 0)
      throw std::runtime_error("ode: no memory for the data of a thread");
  }
  ~ThreadData() { dCleanupODEAllDataForThread(); }
  ThreadData(const ThreadData&) = delete;
  ThreadData& operator=(const ThreadData&) = delete;
};

}  // namespace

void enter_ode() {
  static const Library library;
  thread_local const ThreadData data;
}

std::string ode_version() { return dODE_VERSION; }

}  // namespace duet
