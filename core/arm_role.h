// The role of an arm of a benchmark. Tables rank competitors; controls and oracles stand beside them as lines of
// reference. An arm says its role here, a policy where it is registered (policies/catalogue/registry.h).
#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>

namespace duet {

enum class ArmRole {
  kCompetitor,
  kControl,  // what somebody reaches who does not do the task: the claim of a competitor is its lift over the best one
  kOracle    // knows what no competitor may know
};

struct PolicyRole {
  ArmRole role = ArmRole::kCompetitor;
  std::string_view word = "";  // of a reference, as it stands in brackets after its name: "knows the motion"
};

// Roles by the name that the suite gives a policy; one that is not there competes.
using PolicyRoles = std::map<std::string, PolicyRole>;

// The values of EpisodeRow::arm.
struct EpisodeArmInfo {
  std::string_view name;
  PolicyRole role;  // kCompetitor: that of the policy
};
inline constexpr std::array<EpisodeArmInfo, 4> kEpisodeArms = {
    {{"main", {}},
     {"null", {ArmRole::kControl, "stands still"}},
     {"control", {ArmRole::kControl, "scripted"}},
     {"shuffled", {ArmRole::kControl, "sees the partner of another clip"}}}};

// The role of an episode's arm and policy.
inline PolicyRole role_of(std::string_view arm, const std::string& policy, const PolicyRoles& policies) {
  for (const EpisodeArmInfo& known : kEpisodeArms)
    if (known.name == arm && known.role.role != ArmRole::kCompetitor) return known.role;
  const auto found = policies.find(policy);
  return found == policies.end() ? PolicyRole() : found->second;
}

}  // namespace duet
