#include "core/task.h"

#include <algorithm>
#include <string>
#include <vector>

#include "core/names.h"
#include "core/require.h"

namespace duet {
namespace {

// In the order of Task and of kTasks.
constexpr std::array<std::string_view, 6> kTaskNames = {"hug", "handshake", "high_five", "wave", "bend", "fly_kiss"};

}  // namespace

std::string_view to_string(Task task) { return kTaskNames.at(static_cast<std::size_t>(task)); }

Task parse_task(std::string_view name) {
  std::string underscored(name);
  std::replace(underscored.begin(), underscored.end(), '-', '_');
  const auto* const found = std::find(kTaskNames.begin(), kTaskNames.end(), underscored);
  if (found == kTaskNames.end()) {
    const std::vector<std::string> known(kTaskNames.begin(), kTaskNames.end());
    throw std::invalid_argument(unknown_name_message("task", name, known));
  }
  return kTasks[static_cast<std::size_t>(found - kTaskNames.begin())];
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

}  // namespace duet
