// A descriptor as text with its parts to be changed, observations of a moving robot, and whether a process runs.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <chrono>
#include <fstream>
#include <string>
#include <thread>

#include "duet/core/file.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet::test {

// `text` with `from` replaced by `to`; where it is not there the test would prove nothing.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("the text has no '" + from + "'");
  return text.replace(at, from.size(), to);
}

inline std::string joint_list() { return fmt::format("[{}]", fmt::join(g1()->joint_names(), ", ")); }

// kHistoryFrames frames of a G1 that moves, far from the origin, and of a person.
class MovingHistory {
 public:
  explicit MovingHistory(std::uint64_t seed) {
    Random random(seed, 1);
    for (ObservationFrame& frame : frames_) {
      for (double& value : frame.partner.reshaped()) value = random.normal();
      const Reference reference = random_reference(random, 29);
      frame.robot = {reference.X_WB, Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(4, 5, 6), reference.q, 2 * reference.q};
    }
  }
  [[nodiscard]] Observation at(int tick) const { return {frames_, tick}; }
  ObservationFrame& frame(int i) { return frames_[static_cast<std::size_t>(i)]; }

 private:
  std::array<ObservationFrame, kHistoryFrames> frames_;
};

inline EpisodeContext episode(const RobotState& start) {
  EpisodeContext context;
  context.task = Task::kWave;
  context.prompt = "wave to the person";
  context.start = start;
  context.seed = 7;
  return context;
}

// Whether a process runs; one that ended and waits to be reaped by whoever inherited it does not.
inline bool runs(int pid) {
  std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
  std::string text((std::istreambuf_iterator<char>(stat)), {});
  const std::size_t end = text.rfind(')');
  return end != std::string::npos && text.at(end + 2) != 'Z' && text.at(end + 2) != 'X';
}

// The number that another process writes into a file: waits until it is there.
inline int number_in(const std::string& path) {
  int number = 0;
  for (int i = 0; i < 2000 && number == 0; ++i) {
    std::ifstream(path) >> number;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return number;
}

inline bool ends(int pid) {
  for (int i = 0; i < 2000 && runs(pid); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  return !runs(pid);
}

}  // namespace duet::test
