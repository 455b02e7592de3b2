#include "duet/metrics/contact_safety.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kRounding = 1e-9;  // of a duration in steps, and of a ratio at its bound

// Whole steps within a duration.
int steps_within(double duration, double dt) { return static_cast<int>(std::floor(duration / dt + kRounding)); }

int nearest_steps(double duration, double dt) { return std::max(1, static_cast<int>(std::lround(duration / dt))); }

void require_option(bool holds, const char* name, const char* expected, double found) {
  require(holds, "contact safety: '{}': expected {}, found {}", name, expected, found);
}

void check_positive(const char* name, double value) {
  require_option(std::isfinite(value) && value > 0.0, name, "a finite number > 0", value);
}

void check_not_negative(const char* name, double value) {
  require_option(std::isfinite(value) && value >= 0.0, name, "a finite number >= 0", value);
}

void check(const ContactSafetyOptions& options, double dt) {
  check_positive("hold", options.hold);
  check_positive("dt", dt);
  require_option(dt <= options.hold, "dt", "at most 'hold'", dt);
  check_positive("settle", options.settle);
  check_not_negative("bridge", options.bridge);
  require_option(options.bridge <= options.hold, "bridge", "at most 'hold'", options.bridge);
  check_positive("mean_window", options.mean_window);
  check_not_negative("least_force", options.least_force);
  check_positive("least_patch", options.least_patch);
  for (const double radius : options.link_radius) check_not_negative("link_radius", radius);
  check_positive("default_link_radius", options.default_link_radius);
  require_option(options.max_events >= 0, "max_events", "a number >= 0", options.max_events);
  require_option(options.max_pairs >= 0, "max_pairs", "a number >= 0", options.max_pairs);
}

std::optional<double> ratio(double figure, const std::optional<double>& limit) {
  return limit ? std::optional(figure / *limit) : std::nullopt;
}

void judge(RegionContact& figures, const RegionLimits& limits) {
  figures.pressure_ratio = ratio(figures.pressure_n_cm2, limits.pressure_n_cm2);
  if (limits.transient_allowed) {
    figures.quasi_static_ratio = ratio(figures.quasi_static_force, limits.quasi_static_n);
    figures.transient_ratio = ratio(figures.peak_force, limits.transient_n);
  } else {
    figures.quasi_static_ratio = ratio(figures.peak_force, limits.quasi_static_n);
    figures.transient_ratio = *figures.quasi_static_ratio + (figures.transient_contacts > 0 ? 1.0 : 0.0);
  }
  // An absent ratio is below every number.
  const std::optional<double> settled = limits.transient_allowed ? limits.transient_n : limits.quasi_static_n;
  figures.settled_ratio =
      std::max(ratio(figures.settled_force, settled), ratio(figures.quasi_static_force, limits.quasi_static_n));
  figures.worst_ratio = std::max({figures.quasi_static_ratio, figures.transient_ratio, figures.pressure_ratio});
  if (!limits.transient_allowed && figures.transient_contacts > 0)
    figures.verdict = ContactFinding::kNotAllowed;
  else if (!figures.worst_ratio)
    figures.verdict = ContactFinding::kUnlimited;
  else
    figures.verdict = *figures.worst_ratio > 1.0 + kRounding ? ContactFinding::kOver : ContactFinding::kWithin;
}

void sum_up(ContactSafetyResult& result) {
  bool touched = false;
  for (const RegionContact& region : result.regions) {
    if (region.contacts == 0) continue;
    touched = true;
    result.peak_force = std::max(result.peak_force, region.peak_force);
    result.quasi_static_force = std::max(result.quasi_static_force, region.quasi_static_force);
    result.impulse += region.impulse;
    result.worst_ratio = std::max(result.worst_ratio, region.worst_ratio);
    result.settled_ratio = std::max(result.settled_ratio, region.settled_ratio);
    result.verdict = std::max(result.verdict, region.verdict);
  }
  if (!touched) result.worst_ratio = result.settled_ratio = 0.0;
}

}  // namespace

std::vector<double> link_radii(const RobotModel& robot) {
  std::vector<double> radii(robot.links.size(), 0.0);
  for (const RobotShape& shape : robot.shapes) {
    double& radius = radii[shape.link];
    radius = radius > 0.0 ? std::min(radius, shape.radius) : shape.radius;
  }
  return radii;
}

ContactSafety::Steps ContactSafety::in_steps(const ContactSafetyOptions& options, double dt) {
  check(options, dt);
  return {.hold = steps_within(options.hold, dt),
          .bridge = steps_within(options.bridge, dt),
          .mean = nearest_steps(options.mean_window, dt),
          .settle = nearest_steps(options.settle, dt)};
}

// A force is held over `hold + 1` steps, the shortest span longer than `hold`; so many means over `bridge` lie within.
ContactSafety::Region::Region(const Steps& steps)
    : bridge_mean(std::max(steps.bridge, 1)),
      window_mean(steps.mean),
      held(steps.hold + 2 - std::max(steps.bridge, 1)) {}

ContactSafety::ContactSafety(const HumanBody& human, const ContactLimits& limits, double dt,
                             const ContactSafetyOptions& options)
    : options_(options),
      dt_(dt),
      steps_(in_steps(options, dt)),
      limits_name_(fmt::format("{} ({})", limits.name, limits.mark())),
      limits_verified_(limits.verified()),
      pairs_(options.max_pairs, Pair(steps_.mean)) {
  for (const HumanCapsule& capsule : human.capsules) {
    const auto known = std::find_if(regions_.begin(), regions_.end(),
                                    [&](const Region& region) { return region.figures.region == capsule.region; });
    capsules_.push_back({capsule.radius, static_cast<int>(known - regions_.begin())});
    if (known != regions_.end()) continue;
    Region& region = regions_.emplace_back(steps_);
    region.figures.region = capsule.region;
    region.limits = limits.region(capsule.region);
    require(region.limits.transient_allowed || region.limits.quasi_static_n,
            "contact limits '{}': region '{}': a transient limit of 'not_allowed' needs a quasi-static one",
            limits.name, capsule.region);
  }
  events_.reserve(options.max_events);
}

void ContactSafety::add(std::span<const Contact> contacts) {
  for (const Contact& contact : contacts)
    if (contact.side == ContactSide::kHuman) add_contact(contact);
  for (std::size_t p = 0; p < open_; ++p) end_step(pairs_[p]);
  for (std::size_t p = open_; p-- > 0;)
    if (step_ - pairs_[p].last > steps_.bridge) close(p);
  for (Region& region : regions_) end_step(region);
  ++step_;
}

void ContactSafety::add_contact(const Contact& contact) {
  if (contact.other < 0 || contact.other >= static_cast<int>(capsules_.size()))
    throw std::invalid_argument(
        fmt::format("contact safety: expected a capsule below {}, found {}", capsules_.size(), contact.other));
  if (!contact.f_W.allFinite() || !std::isfinite(contact.depth)) {
    ++contacts_not_finite_;
    return;
  }
  const double force = contact.f_W.norm();
  if (force < options_.least_force || force == 0.0) return;
  Region& region = regions_[capsules_[contact.other].region];
  region.sum += contact.f_W;
  if (Pair* pair = find_or_open(contact); pair != nullptr) {
    pair->sum += contact.f_W;
    pair->depth = std::max(pair->depth, contact.depth);
    pair->last = step_;
  } else {
    ++contacts_unfollowed_;
    bear(region, force, contact.depth, patch_radius(contact.link, contact.other));
  }
}

ContactSafety::Pair* ContactSafety::find_or_open(const Contact& contact) {
  for (std::size_t p = 0; p < open_; ++p)
    if (pairs_[p].event.link == contact.link && pairs_[p].event.capsule == contact.other) return &pairs_[p];
  if (open_ == pairs_.size()) return nullptr;
  Pair& pair = pairs_[open_++];
  pair.event = {
      {.begin_s = static_cast<double>(step_) * dt_}, contact.link, contact.other, capsules_[contact.other].region};
  pair.mean.clear();
  pair.patch_radius = patch_radius(contact.link, contact.other);
  pair.begin = step_;
  return &pair;
}

double ContactSafety::patch_radius(int link, int capsule) const {
  const bool known = link >= 0 && link < static_cast<int>(options_.link_radius.size());
  const double given = known ? options_.link_radius[link] : 0.0;
  const double robot = given > 0.0 ? given : options_.default_link_radius;
  const double human = capsules_[capsule].radius;
  return human * robot / (human + robot);
}

void ContactSafety::end_step(Pair& pair) {
  ContactEvent& event = pair.event;
  const double force = pair.sum.norm();
  event.windowed_mean_n = std::max(event.windowed_mean_n, pair.mean.push(force));
  if (pair.last == step_) {
    event.duration_s = static_cast<double>(step_ - pair.begin + 1) * dt_;
    event.peak_n = std::max(event.peak_n, force);
    event.impulse_ns += force * dt_;
    event.depth_m = std::max(event.depth_m, pair.depth);
    bear(regions_[event.region], force, pair.depth, pair.patch_radius);
  }
  pair.sum.setZero();
  pair.depth = 0.0;
}

void ContactSafety::bear(Region& region, double pair_force, double depth, double patch_radius) const {
  constexpr double kPerSquareCentimetre = 1e-4;  // N/m^2 in N/cm^2
  const double patch = std::max(options_.least_patch, 2.0 * std::numbers::pi * patch_radius * depth);
  region.largest_pair = std::max(region.largest_pair, pair_force);
  region.figures.peak_pair_force = std::max(region.figures.peak_pair_force, pair_force);
  region.figures.pressure_n_cm2 = std::max(region.figures.pressure_n_cm2, kPerSquareCentimetre * pair_force / patch);
}

void ContactSafety::end_step(Region& region) {
  RegionContact& figures = region.figures;
  const double force = std::max(region.sum.norm(), region.largest_pair);
  region.sum.setZero();
  region.largest_pair = 0.0;
  if (force > 0.0 && (figures.contacts == 0 || step_ - region.last > steps_.bridge + 1)) begin_contact(region);
  if (figures.contacts == 0) return;
  figures.windowed_mean = std::max(figures.windowed_mean, region.window_mean.push(force));
  const double held = region.held.push(region.bridge_mean.push(force));
  if (force == 0.0) return;

  region.last = step_;
  const std::int64_t length = step_ - region.begin + 1;
  if (length <= steps_.hold) {
    figures.transient_force = std::max(figures.transient_force, force);
  } else {
    figures.quasi_static_force = std::max(figures.quasi_static_force, held);
    if (!region.lasting) --figures.transient_contacts;
    region.lasting = true;
  }
  if (length > steps_.settle) figures.settled_force = std::max(figures.settled_force, force);
  figures.longest = std::max(figures.longest, static_cast<double>(length) * dt_);
  figures.peak_force = std::max(figures.peak_force, force);
  figures.impulse += force * dt_;
}

void ContactSafety::begin_contact(Region& region) {
  ++region.figures.contacts;
  ++region.figures.transient_contacts;
  region.begin = step_;
  region.lasting = false;
}

void ContactSafety::close(std::size_t pair) {
  if (events_.size() < static_cast<std::size_t>(options_.max_events))
    events_.push_back(pairs_[pair].event);
  else
    ++events_left_out_;
  if (pair != --open_) std::swap(pairs_[pair], pairs_[open_]);
}

ContactSafetyResult ContactSafety::result() const {
  ContactSafetyResult result{.regions = {},
                             .events = events_,
                             .events_left_out = events_left_out_,
                             .contacts_unfollowed = contacts_unfollowed_,
                             .contacts_not_finite = contacts_not_finite_,
                             .duration = static_cast<double>(step_) * dt_,
                             .limits = limits_name_,
                             .limits_verified = limits_verified_};
  for (const Region& region : regions_) judge(result.regions.emplace_back(region.figures), region.limits);
  for (std::size_t p = 0; p < open_; ++p) {
    if (result.events.size() < static_cast<std::size_t>(options_.max_events))
      result.events.push_back(pairs_[p].event);
    else
      ++result.events_left_out;
  }
  std::sort(result.events.begin(), result.events.end(), [](const ContactEvent& a, const ContactEvent& b) {
    return std::tie(a.begin_s, a.link, a.capsule) < std::tie(b.begin_s, b.link, b.capsule);
  });
  sum_up(result);
  return result;
}

// Contact safety as names and numbers for rows, and as text.

std::string_view contact_verdict_name(ContactFinding verdict) {
  switch (verdict) {
    case ContactFinding::kWithin:
      return "within";
    case ContactFinding::kUnlimited:
      return "unlimited";
    case ContactFinding::kOver:
      return "over";
    case ContactFinding::kNotAllowed:
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

}  // namespace duet
