// The six interaction tasks (supplement B.1) and the three phases of each (supplement B.4).
#pragma once

#include <array>
#include <string_view>

namespace duet {

enum class Task { kHug, kHandshake, kHighFive, kWave, kBend, kFlyKiss };

inline constexpr std::array<Task, 6> kTasks = {Task::kHug,  Task::kHandshake, Task::kHighFive,
                                               Task::kWave, Task::kBend,      Task::kFlyKiss};

// "hug", "handshake", "high_five", "wave", "bend", "fly_kiss": the names in files, messages and reports.
std::string_view to_string(Task task);

// Accepts '-' for '_'. Throws std::invalid_argument for an unknown name and lists the known ones, with the nearest
// first.
Task parse_task(std::string_view name);

enum class Phase { kPreparation, kAct, kFollowUp };
std::string_view to_string(Phase phase);  // "preparation", "act", "follow_up"

// Frames [0, act_begin) are preparation, [act_begin, act_end) act, [act_end, frames) follow-up.
struct Phases {
  int act_begin = 0;
  int act_end = 0;

  [[nodiscard]] Phase at(int frame) const {
    return frame < act_begin ? Phase::kPreparation : frame < act_end ? Phase::kAct : Phase::kFollowUp;
  }
  bool operator==(const Phases&) const = default;
};

}  // namespace duet
