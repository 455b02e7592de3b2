// A program of our own that runs beside this one. Thread-safe.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace duet {

// The file that a command's first word names: a path with a '/' from `folder`, another word from PATH. Throws
// MissingError where there is none that can be run.
std::string find_program(const std::string& word, const std::string& folder);

// A program that lives no longer than this object and this process, whatever happens to either (Linux). Its messages go
// over a socket that it inherits: a variable of its environment names the descriptor. It reads nothing from stdin, and
// what it prints goes to stderr.
class ChildProcess {
 public:
  // Runs `command` in `folder`; the child gets `socket`, which stays the caller's, and its number as `variable`. Throws
  // MissingError where it cannot be run.
  ChildProcess(const std::vector<std::string>& command, const std::string& folder, const std::string& variable,
               int socket);
  ~ChildProcess();  // kills it and whatever it started in its process group
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  void kill();
  // "exit status 3" or "signal 9 (Killed)" once it has ended; none where it has not within `timeout`.
  std::optional<std::string> ended(std::chrono::milliseconds timeout);

 private:
  struct Launch;
  void keep(const Launch& launch);

  std::mutex mutex_;
  std::condition_variable changed_;
  bool started_ = false;
  int pid_ = -1;
  int error_ = 0;              // why it could not be run (errno)
  std::optional<int> status_;  // of waitpid
  // Starts the child and waits for it. Linux ends a child with the thread that started it, so that thread must not be
  // the caller's; and nothing else may reap it.
  std::thread keeper_;
};

}  // namespace duet
