#include "duet/core/task.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr auto kTaskNames = std::to_array<std::string_view>({
#include "task_list.inc"
});

template <std::size_t... I>
constexpr bool begins_with_the_papers(const std::array<std::string_view, sizeof...(I)>& names,
                                      std::index_sequence<I...>) {
  return ((kTaskNames[I] == names[I] && kPaperTasks[I].index() == static_cast<int>(I)) && ...);
}
static_assert(begins_with_the_papers({"hug", "handshake", "high_five", "wave", "bend", "fly_kiss"},
                                     std::make_index_sequence<kPaperTasks.size()>()),
              "tasks/list.cmake begins with the six tasks of the supplement in its order");

}  // namespace

// The one place where a Task is made of a number.
struct TaskList {
  template <std::size_t... I>
  static constexpr std::array<Task, sizeof...(I)> of(std::index_sequence<I...>) {
    return {Task(static_cast<int>(I))...};
  }
};

std::span<const Task> all_tasks() {
  static constexpr auto kAll = TaskList::of(std::make_index_sequence<kTaskNames.size()>());
  return kAll;
}

std::string_view to_string(Task task) { return kTaskNames.at(static_cast<std::size_t>(task.index())); }

std::vector<std::string> task_names(std::span<const Task> tasks) {
  std::vector<std::string> names;
  names.reserve(tasks.size());
  for (const Task task : tasks) names.emplace_back(to_string(task));
  return names;
}

Task parse_task(std::string_view name) {
  std::string underscored(name);
  std::replace(underscored.begin(), underscored.end(), '-', '_');
  const auto* const found = std::find(kTaskNames.begin(), kTaskNames.end(), underscored);
  if (found == kTaskNames.end())
    throw std::invalid_argument(unknown_name_message("task", name, task_names(all_tasks())));
  return all_tasks()[static_cast<std::size_t>(found - kTaskNames.begin())];
}

std::string_view to_string(Phase phase) {
  switch (phase) {
    case Phase::kPreparation:
      return "preparation";
    case Phase::kAct:
      return "act";
    case Phase::kFollowUp:
      return "follow_up";
  }
  throw std::invalid_argument("phase out of range");
}

namespace {

// In the order of Outcome.
constexpr std::array<std::string_view, 6> kOutcomeNames = {"ok", "fell", "diverged", "timeout", "unsupported", "error"};

}  // namespace

std::string_view to_string(Outcome outcome) { return kOutcomeNames.at(static_cast<std::size_t>(outcome)); }

Outcome parse_outcome(std::string_view name) {
  const auto* const found = std::find(kOutcomeNames.begin(), kOutcomeNames.end(), name);
  if (found == kOutcomeNames.end()) {
    const std::vector<std::string> known(kOutcomeNames.begin(), kOutcomeNames.end());
    throw std::invalid_argument(unknown_name_message("outcome", name, known));
  }
  return static_cast<Outcome>(found - kOutcomeNames.begin());
}

}  // namespace duet
