// Which task an interaction is, and the three phases of each (supplement B.4). The supplement's six tasks (B.1) have
// names in code; every other is a row of tasks/list.cmake and is asked for by its name (docs/extending.md, "A task").
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// A place in the list of tasks. The task's TaskDefinition says what it is (tasks/task_definition.h).
class Task {
 public:
  static const Task kHug, kHandshake, kHighFive, kWave, kBend, kFlyKiss;

  // In all_tasks().
  [[nodiscard]] constexpr int index() const { return index_; }
  constexpr auto operator<=>(const Task&) const = default;

 private:
  friend struct TaskList;
  constexpr explicit Task(int index) : index_(index) {}

  int index_;
};

inline constexpr Task Task::kHug{0};
inline constexpr Task Task::kHandshake{1};
inline constexpr Task Task::kHighFive{2};
inline constexpr Task Task::kWave{3};
inline constexpr Task Task::kBend{4};
inline constexpr Task Task::kFlyKiss{5};

// The six tasks of the supplement, in its order: what "all tasks" means in suites and commands, and what networks that
// were made before there was a seventh know.
inline constexpr std::array<Task, 6> kPaperTasks = {Task::kHug,  Task::kHandshake, Task::kHighFive,
                                                    Task::kWave, Task::kBend,      Task::kFlyKiss};

// Every task that there is: those of the supplement first, then the others as tasks/list.cmake has them.
std::span<const Task> all_tasks();

// "hug", "handshake", "high_five", ...: the names in files, messages and reports.
std::string_view to_string(Task task);
std::vector<std::string> task_names(std::span<const Task> tasks);

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
