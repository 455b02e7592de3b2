// A policy in a process of its own, started here or already running: observation -> message -> plan. A process that is
// late, answers nonsense or dies costs a plan and is counted (Policy::faults); it never stops duet.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "duet/policies/external/descriptor.h"
#include "duet/policies/policy.h"

namespace duet {

// Starts or connects; hello is said at the first reset, and where its answer fails the policy is dead, with the reason.
// Throws InputError for joints that are not the robot's, MissingError where the program is not there.
std::unique_ptr<Policy> make_process_policy(const PolicyDescriptor& descriptor,
                                            const std::shared_ptr<const RobotModel>& robot);

// A program that lives no longer than this object and this process, whatever happens to either (Linux). Its messages go
// over a socket that it inherits: the variable DUET_POLICY_FD names the descriptor. It reads nothing from stdin, and
// what it prints goes to stderr.

// The file that a command's first word names: a path with a '/' from `folder`, another word from PATH. Throws
// MissingError where there is none that can be run.
std::string find_program(const std::string& word, const std::string& folder);

class ChildProcess {
 public:
  // Runs `command` in `folder`; the child gets `socket`, which stays the caller's. Throws MissingError where it cannot
  // be run.
  ChildProcess(const std::vector<std::string>& command, const std::string& folder, int socket);
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
