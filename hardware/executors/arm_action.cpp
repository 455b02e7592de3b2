#include "duet/hardware/executors/arm_action.h"

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "duet/core/names.h"

namespace duet {

const ArmPreset* arm_preset(int id) {
  const auto found = std::ranges::find(kArmPresets, id, &ArmPreset::id);
  return found == kArmPresets.end() ? nullptr : &*found;
}

const ArmPreset& arm_preset(const std::string& name) {
  const auto found = std::ranges::find(kArmPresets, name, &ArmPreset::name);
  if (found != kArmPresets.end()) return *found;
  std::vector<std::string> names;
  for (const ArmPreset& preset : kArmPresets) names.emplace_back(preset.name);
  throw std::invalid_argument(unknown_name_message("arm action", name, names));
}

}  // namespace duet
