// The process of an engine that runs outside of duet, and the frames that pass between the two over a socket: one
// request, one answer (docs/extending.md, "A host"). One thread at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/child_process.h"

namespace duet {

inline constexpr std::string_view kHostProtocol = "duet.host/1";

// How the host of an engine is started. Its socket is the descriptor that the variable DUET_HOST_FD names.
struct HostProgram {
  std::string engine;                      // "mujoco3", as messages and the protocol name it
  std::string version;                     // that the host has to answer with; "": any
  std::vector<std::string> command;        // a word without a '/' is looked for in PATH
  std::string folder = ".";                // that it runs in
  std::chrono::milliseconds start{30000};  // at most, for the answer to a scene
  std::chrono::milliseconds hang{10000};   // at most, for the answer to a step

  [[nodiscard]] bool operator==(const HostProgram&) const = default;
};

// The answer of a host that has taken a scene.
struct HostFacts {
  std::string version;  // of the engine
  int memory = 0;       // numbers that a step needs of the one before it, beyond the state
  int contacts = 0;     // the most that a step reports
};

// Every function throws std::runtime_error with one sentence that begins with the engine's name where the host has
// ended, is late, answers with another size, number or kind than it was asked for, or says itself what is wrong. The
// host is ended then, and stays so.
class HostProcess {
 public:
  explicit HostProcess(const HostProgram& program);  // throws MissingError where the program cannot be run
  ~HostProcess();
  HostProcess(const HostProcess&) = delete;
  HostProcess& operator=(const HostProcess&) = delete;

  // Gives the host the scene that all following steps are of. `scene`: its JSON (backends/host/host_scene.h).
  HostFacts open(const nlohmann::json& scene);
  // The answer to one step, `least` to `most` numbers. Valid until the next call. No allocation after the first one.
  std::span<const double> step(std::span<const double> request, std::size_t least, std::size_t most);

  // For what an answer says: ends the host and throws.
  [[noreturn]] void refuse(const std::string& fault);
  // False once it was given up, has ended, or has sent something that nobody asked for.
  [[nodiscard]] bool is_waiting() const;
  [[nodiscard]] const HostProgram& program() const { return program_; }

 private:
  struct Head {  // of a frame, little endian
    std::uint32_t bytes = 0, kind = 0;
    std::uint64_t number = 0;
  };
  void send(std::uint32_t kind, std::span<const char> content);
  // The answer to the frame sent last, of `kind` and with `least` to `most` bytes.
  std::span<const char> receive(std::uint32_t kind, std::size_t least, std::size_t most);
  void read_exactly(std::span<char> to);
  void set_limit(std::chrono::milliseconds limit);
  [[noreturn]] void lose();
  [[noreturn]] void be_late();

  HostProgram program_;
  int socket_ = -1;  // -1 once the host has been given up
  std::uint64_t number_ = 0;
  std::chrono::milliseconds limit_{0};
  std::chrono::steady_clock::time_point asked_;
  std::vector<double> answer_;  // of doubles, so that numbers in it are aligned
  std::optional<ChildProcess> child_;
};

// Hosts that have opened a scene before and wait for the next: a run makes a world for each episode, and starting an
// engine's runtime takes longer than the episode's first second. Thread-safe; they end with the program.
std::unique_ptr<HostProcess> take_host(const HostProgram& program);
void give_back(std::unique_ptr<HostProcess> host);  // one that is no longer waiting is dropped

}  // namespace duet
