#include "duet/hardware/executors/arm_action.h"

#include <fmt/format.h>

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

RpcRequest action_request(std::int64_t id, int action) {
  RpcRequest request{.id = id, .call = ServiceCall::kDoArmAction, .parameter = {}};
  fmt::format_to_n(request.parameter.data(), request.parameter.size() - 1, "{{\"data\":{}}}", action);
  return request;
}

}  // namespace duet
