// Contact safety as names and numbers for rows, and as text.
#include <fmt/format.h>

#include <algorithm>

#include "duet/metrics/contact_safety.h"

namespace duet {

std::string_view contact_verdict_name(ContactVerdict verdict) {
  switch (verdict) {
    case ContactVerdict::kWithin:
      return "within";
    case ContactVerdict::kUnlimited:
      return "unlimited";
    case ContactVerdict::kOver:
      return "over";
    case ContactVerdict::kNotAllowed:
      return "not allowed";
  }
  return "";
}

std::map<std::string, double> contact_forces(const ContactSafetyResult& result) {
  std::map<std::string, double> forces{{"human.peak_n", result.peak_force},
                                       {"human.impulse_ns", result.impulse},
                                       {"human.limits_verified", result.limits_verified ? 1.0 : 0.0}};
  if (result.worst_ratio) forces["human.worst_ratio"] = *result.worst_ratio;
  if (result.settled_ratio) forces["human.settled_ratio"] = *result.settled_ratio;
  double& settled = forces["human.settled_n"];
  for (const RegionContact& region : result.regions) {
    if (region.contacts == 0) continue;
    settled = std::max(settled, region.settled_force);
    const std::string prefix = "human." + region.region + ".";
    forces[prefix + "peak_n"] = region.peak_force;
    forces[prefix + "quasi_static_n"] = region.quasi_static_force;
    forces[prefix + "transient_n"] = region.transient_force;
    forces[prefix + "settled_n"] = region.settled_force;
    forces[prefix + "impulse_ns"] = region.impulse;
    forces[prefix + "pressure_n_cm2"] = region.pressure_n_cm2;
    if (region.worst_ratio) forces[prefix + "worst_ratio"] = *region.worst_ratio;
  }
  return forces;
}

std::map<std::string, double> contact_safety_metrics(const ContactSafetyResult& result) {
  std::map<std::string, double> metrics{{"contact_peak_force", result.peak_force},
                                        {"contact_quasi_static_force", result.quasi_static_force},
                                        {"contact_impulse", result.impulse}};
  if (result.worst_ratio) metrics["contact_limit_ratio"] = *result.worst_ratio;
  return metrics;
}

std::string contact_safety_text(const ContactSafetyResult& result) {
  std::string text =
      fmt::format("contacts with the person, limits {}: {}\n", result.limits, contact_verdict_name(result.verdict));
  for (const RegionContact& region : result.regions) {
    if (region.contacts == 0) continue;
    text += fmt::format("  {}: peak {:.1f} N, held {:.1f} N, {:.2f} N s, about {:.1f} N/cm2, ", region.region,
                        region.peak_force, region.quasi_static_force, region.impulse, region.pressure_n_cm2);
    if (region.worst_ratio) text += fmt::format("{:.2f} of the limit, ", *region.worst_ratio);
    text += fmt::format("{}\n", contact_verdict_name(region.verdict));
  }
  return text;
}

}  // namespace duet
