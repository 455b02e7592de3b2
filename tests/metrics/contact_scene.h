// A body of six capsules, a table of limits and contacts with them, for the tests of contact safety.
#pragma once

#include <cmath>
#include <functional>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "duet/metrics/contact_safety.h"

namespace duet::test {

inline constexpr double kRounding = 1e-9;  // of sums over some thousand steps

// Capsules of the test's body.
enum Capsule { kChestA, kChestB, kHead, kHandLeft, kHandRight, kFoot };

inline HumanBody contact_body() {
  HumanBody human;
  const auto add = [&](const char* name, const char* region, double radius) {
    HumanCapsule capsule;
    capsule.name = name;
    capsule.region = region;
    capsule.radius = radius;
    human.capsules.push_back(capsule);
  };
  add("upper_chest", "chest", 0.12);
  add("lower_chest", "chest", 0.12);
  add("head", "head", 0.1);
  add("left_hand", "hand", 0.03);
  add("right_hand", "hand", 0.03);
  add("left_foot", "foot", 0.035);
  return human;
}

// Nothing is stated for the foot.
inline ContactLimits contact_table() {
  return {.name = "table",
          .source = "test",
          .verified_by = "",
          .regions = {{.region = "chest", .quasi_static_n = 140.0, .transient_n = 280.0, .pressure_n_cm2 = 120.0},
                      {.region = "head", .quasi_static_n = 65.0, .transient_allowed = false, .pressure_n_cm2 = 110.0},
                      {.region = "hand", .quasi_static_n = 140.0, .transient_n = 280.0},
                      {.region = "foot"}}};
}

inline constexpr double kDepth = 0.02;  // wide patches: no pressure near its limit

inline Contact touch(int capsule, const Eigen::Vector3d& force, int link = 0, double depth = kDepth) {
  return {.link = link, .side = ContactSide::kHuman, .other = capsule, .f_W = force, .depth = depth};
}

inline Contact touch(int capsule, double force, int link = 0, double depth = kDepth) {
  return touch(capsule, Eigen::Vector3d(force, 0.0, 0.0), link, depth);
}

using ContactsAt = std::function<std::vector<Contact>(double)>;  // by time in the middle of a step

inline ContactSafetyResult fed(double duration, const ContactsAt& contacts, double dt = 0.002,
                               const ContactSafetyOptions& options = {},
                               const ContactLimits& limits = contact_table()) {
  ContactSafety safety(contact_body(), limits, dt, options);
  const int steps = static_cast<int>(std::lround(duration / dt));
  for (int k = 0; k < steps; ++k) safety.add(contacts((k + 0.5) * dt));
  return safety.result();
}

// `force` on one capsule within [begin, end).
inline ContactsAt pulse(int capsule, double force, double begin, double end) {
  return [=](double t) { return t > begin && t < end ? std::vector{touch(capsule, force)} : std::vector<Contact>(); };
}

inline const RegionContact& region(const ContactSafetyResult& result, std::string_view name) {
  for (const RegionContact& entry : result.regions)
    if (entry.region == name) return entry;
  throw std::out_of_range("no region");
}

}  // namespace duet::test
