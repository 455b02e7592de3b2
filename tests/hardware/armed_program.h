// `duet hw arm` as a process of its own, its word typed as a person would, and what it says of its states; a twin and
// what else belongs to it beside it. For tests in real time: a machine with other work to do may hold the guard up,
// which it answers as it has to; whoever uses this tries again then.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

extern char** environ;

namespace duet::test {

// Killed when it goes out of scope.
class OwnProcess {
 public:
  // With pipes to its standard input and from its standard error where `talks`, otherwise silent.
  explicit OwnProcess(const std::vector<std::string>& arguments, bool talks = false) {
    std::vector<std::string> all = arguments;
    std::vector<char*> raw;
    for (std::string& argument : all) raw.push_back(argument.data());
    raw.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    int in[2] = {-1, -1}, err[2] = {-1, -1};
    if (talks && pipe2(in, O_CLOEXEC) == 0 && pipe2(err, O_CLOEXEC) == 0) {
      posix_spawn_file_actions_adddup2(&actions, in[0], STDIN_FILENO);
      posix_spawn_file_actions_adddup2(&actions, err[1], STDERR_FILENO);
    } else {
      posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    }
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    if (posix_spawn(&pid_, all.front().c_str(), &actions, nullptr, raw.data(), environ) != 0) pid_ = -1;
    posix_spawn_file_actions_destroy(&actions);
    if (!talks) return;
    close(in[0]);
    close(err[1]);
    in_ = in[1];
    err_ = err[0];
  }
  OwnProcess(const OwnProcess&) = delete;
  OwnProcess& operator=(const OwnProcess&) = delete;
  ~OwnProcess() {
    if (pid_ > 0) {
      send(SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    if (in_ >= 0) close(in_);
    if (err_ >= 0) close(err_);
  }

  void send(int signal) const { kill(pid_, signal); }
  void type(const std::string& line) const { (void)!write(in_, (line + "\n").c_str(), line.size() + 1); }
  // Reads what it says until `text` stands in it; false after `seconds`, or where it has ended.
  bool says(const std::string& text, double seconds) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (said_.find(text, from_) == std::string::npos) {
      pollfd wait{err_, POLLIN, 0};
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      if (left.count() <= 0 || poll(&wait, 1, static_cast<int>(left.count())) <= 0) return false;
      char buffer[4096];
      const ssize_t size = read(err_, buffer, sizeof(buffer));
      if (size <= 0) return false;
      said_.append(buffer, static_cast<std::size_t>(size));
    }
    from_ = said_.find(text, from_) + text.size();
    return true;
  }
  [[nodiscard]] const std::string& said() const { return said_; }
  // Its exit code once it has ended, -1 after `seconds`.
  int exit_code(double seconds) {
    for (double left = seconds; left > 0.0; left -= 0.02) {
      int status = 0;
      if (waitpid(pid_, &status, WNOHANG) == pid_) {
        pid_ = -1;
        return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
      }
      usleep(20000);
    }
    return -1;
  }

 private:
  pid_t pid_ = -1;
  int in_ = -1, err_ = -1;
  std::string said_;
  std::size_t from_ = 0;
};

// Types the word that it shows; false where it shows none.
inline bool arm_by_its_word(OwnProcess& guard) {
  if (!guard.says("type '", 10.0) || !guard.says("within", 5.0)) return false;
  const std::string& said = guard.said();
  const std::size_t begin = said.find("type '") + 6;
  guard.type(said.substr(begin, said.find('\'', begin) - begin));
  return true;
}

// Whether the guard says that this machine held it, or the twin, up. `but`: the cause that the trial itself brings
// about.
inline bool held_up(const std::string& said, const std::string& but) {
  constexpr const char* kLate[] = {"loop_late", "state_age", "remote_age", "dead_man", "odometry_age", "executor_age"};
  return std::ranges::any_of(kLate, [&](const std::string& cause) {
    return cause != but && (said.find("(" + cause + ")") != std::string::npos ||
                            said.find("lately missing: " + cause) != std::string::npos);
  });
}

}  // namespace duet::test
