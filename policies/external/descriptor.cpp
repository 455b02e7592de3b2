#include "duet/policies/external/descriptor.h"

#include <filesystem>

#include "duet/core/file.h"

namespace duet {

std::string PolicyDescriptor::folder() const {
  const std::string parent = std::filesystem::path(file).parent_path().string();
  return parent.empty() ? "." : parent;
}

std::string_view to_string(PolicyFrame frame) { return frame == PolicyFrame::kWorld ? "world" : "ego"; }

std::string_view to_string(PlanFrame frame) {
  switch (frame) {
    case PlanFrame::kWorld:
      return "world";
    case PlanFrame::kEgo:
      return "ego";
    case PlanFrame::kDisplacement:
      return "displacement";
  }
  return "";
}

PolicyDescriptor read_policy_descriptor(const std::string& path) {
  return parse_policy_descriptor(read_text(path), path);
}

}  // namespace duet
