// The last note of a worker that crashes: which episode its thread was at, and the signal. A handler can reach nothing
// but globals, and there is one for the process.
#pragma once

#include <string_view>

namespace duet {

// From now on SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT append "crashed KEY SIGNAL" to this file before they end the
// program as they would; -1: they do not any more.
void note_crashes_in(int descriptor);

// This thread is at an episode, as long as the object lives. Also a stack for the handler, so that a stack that
// overflows is noted.
class CrashScope {
 public:
  explicit CrashScope(std::string_view key);
  ~CrashScope();
  CrashScope(const CrashScope&) = delete;
  CrashScope& operator=(const CrashScope&) = delete;
};

}  // namespace duet
