#include "duet/core/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "duet/core/require.h"

namespace duet {

// Everything the child needs, made before fork: after it, only what is safe in a signal handler may be called.
struct ChildProcess::Launch {
  std::string program, folder;
  std::vector<std::string> words, variables;
  std::vector<char*> arguments, environment;
  int socket = -1;
  int parent = 0;
};

namespace {

bool can_run(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored) && access(path.c_str(), X_OK) == 0;
}

std::vector<char*> pointers(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

std::vector<std::string> environment_with(const std::string& variable, int socket) {
  const std::string own = fmt::format("{}=", variable);
  std::vector<std::string> variables;
  for (char** entry = environ; *entry != nullptr; ++entry)
    if (!std::string_view(*entry).starts_with(own)) variables.emplace_back(*entry);
  variables.push_back(fmt::format("{}{}", own, socket));
  return variables;
}

std::string describe_status(int status) {
  if (WIFSIGNALED(status)) return fmt::format("signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
  return fmt::format("exit status {}", WEXITSTATUS(status));
}

// In the child, between fork and exec. Returns only where something failed.
void become(const char* program, const char* folder, char* const* arguments, char* const* environment, int socket,
            int parent) {
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  setpgid(0, 0);  // Ctrl-C in the terminal is for duet, which ends its children itself
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) return;  // it died before the line above
  const int nothing = open("/dev/null", O_RDONLY);
  if (nothing < 0 || dup2(nothing, STDIN_FILENO) < 0 || dup2(STDERR_FILENO, STDOUT_FILENO) < 0) return;
  if (fcntl(socket, F_SETFD, 0) < 0 || chdir(folder) < 0) return;
  execve(program, arguments, environment);
}

}  // namespace

std::string find_program(const std::string& word, const std::string& folder) {
  namespace fs = std::filesystem;
  if (word.find('/') != std::string::npos) {
    const fs::path path = fs::path(folder) / word;
    if (!can_run(path)) throw MissingError(fmt::format("cannot run '{}': no such program", path.string()));
    return fs::absolute(path).string();
  }
  const char* variable = std::getenv("PATH");
  std::string_view rest = variable == nullptr ? "" : variable;
  while (!rest.empty()) {
    const std::size_t colon = std::min(rest.find(':'), rest.size());
    const fs::path path = fs::path(rest.substr(0, colon)) / word;
    if (colon > 0 && can_run(path)) return fs::absolute(path).string();
    rest.remove_prefix(std::min(colon + 1, rest.size()));
  }
  throw MissingError(fmt::format("cannot run '{}': no such program in PATH", word));
}

ChildProcess::ChildProcess(const std::vector<std::string>& command, const std::string& folder,
                           const std::string& variable, int socket) {
  require(!command.empty(), "child process: expected a command, found none");
  Launch launch{.program = find_program(command[0], folder),
                .folder = folder,
                .words = command,
                .variables = environment_with(variable, socket),
                .arguments = {},
                .environment = {},
                .socket = socket,
                .parent = getpid()};
  launch.arguments = pointers(launch.words);
  launch.environment = pointers(launch.variables);
  keeper_ = std::thread([this, &launch] { keep(launch); });
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return started_; });
  if (error_ == 0) return;
  lock.unlock();
  keeper_.join();
  throw MissingError(fmt::format("cannot run '{}': {}", launch.program, std::strerror(error_)));
}

ChildProcess::~ChildProcess() {
  kill();
  keeper_.join();
}

void ChildProcess::kill() {
  const std::lock_guard lock(mutex_);
  if (!status_) ::kill(-pid_, SIGKILL);
}

std::optional<std::string> ChildProcess::ended(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  if (!changed_.wait_for(lock, timeout, [this] { return status_.has_value(); })) return std::nullopt;
  return describe_status(*status_);
}

// The thread's whole life. `launch` is the constructor's and gone once started_ is set.
void ChildProcess::keep(const Launch& launch) {
  std::array<int, 2> failure{-1, -1};  // closed by a successful exec
  int error = pipe2(failure.data(), O_CLOEXEC) == 0 ? 0 : errno;
  const int pid = error == 0 ? fork() : -1;
  if (pid == 0) {
    become(launch.program.c_str(), launch.folder.c_str(), launch.arguments.data(), launch.environment.data(),
           launch.socket, launch.parent);
    error = errno;
    (void)!write(failure[1], &error, sizeof error);
    _exit(127);
  }
  if (pid < 0 && error == 0) error = errno;
  close(failure[1]);
  while (pid > 0 && read(failure[0], &error, sizeof error) < 0 && errno == EINTR) {
  }
  close(failure[0]);
  if (pid > 0 && error != 0) waitpid(pid, nullptr, 0);
  {
    const std::lock_guard lock(mutex_);
    started_ = true;
    error_ = error;
    pid_ = pid;
    changed_.notify_all();
  }
  if (error != 0) return;
  siginfo_t info{};
  while (waitid(P_PID, static_cast<id_t>(pid), &info, WEXITED | WNOWAIT) < 0 && errno == EINTR) {
  }
  const std::lock_guard lock(mutex_);
  ::kill(-pid, SIGKILL);  // what it started; its number cannot be another's before it is reaped
  int status = 0;
  waitpid(pid, &status, 0);
  status_ = status;
  changed_.notify_all();
}

}  // namespace duet
