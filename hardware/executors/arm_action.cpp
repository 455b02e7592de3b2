#include "duet/hardware/executors/arm_action.h"

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "duet/core/named_table.h"

namespace duet {

const ArmPreset* arm_preset(int id) {
  const auto found = std::ranges::find(kArmPresets, id, &ArmPreset::id);
  return found == kArmPresets.end() ? nullptr : &*found;
}

const ArmPreset& arm_preset(const std::string& name) { return entry_named(kArmPresets, "arm action", name); }

}  // namespace duet
