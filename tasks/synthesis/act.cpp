#include "duet/tasks/synthesis/act.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace duet::synthesis {
namespace {

// How far in front of the root a hand at height z is when it uses `share` of the arm.
double reach_ahead(const Body& body, int side, double z, double share, const Lean& lean) {
  const Eigen::Vector3d shoulder = shoulder_at(body, side, lean);
  const double length = share * body.arm();
  const double square = length * length - std::pow(z - shoulder.z(), 2) - std::pow(shoulder.y(), 2);
  return shoulder.x() + std::sqrt(std::max(square, 0.0));
}

// From `from`, straight and with the hips turned as the manner has it: the hand gets to the point on the way, too.
Lean lean_to_meet(const Participants& cast, int person, const Layout& layout, const Lean& from, double share) {
  Lean lean = from;
  for (const double hips : {0.0, -side_sign(cast.side) * cast.manner.turn[person]}) {
    lean.hips = hips;
    lean = lean_to_reach(cast.body[person], cast.side, seen_by(person, layout, layout.meet), lean, share);
  }
  return lean;
}

// On the line between the roots, which are then where the manner has them.
void meet_between(const Participants& cast, double share_of_a, Layout& layout) {
  stand_at_bearings(cast, layout);
  layout.meet.head<2>() = share_of_a * Eigen::Vector2d(layout.distance, layout.lateral);
}

}  // namespace

Eigen::Vector3d in_world(const Placement& placement, const Eigen::Vector3d& point) {
  const Eigen::Vector3d origin(placement.position.x(), placement.position.y(), 0.0);
  return origin + rot_z(placement.yaw) * point;
}

Eigen::Vector3d seen_by(int person, const Layout& layout, const Eigen::Vector3d& point_of_a) {
  if (person == 0) return point_of_a;
  const Eigen::Vector3d ahead(layout.distance - point_of_a.x(), layout.lateral - point_of_a.y(), point_of_a.z());
  return layout.turn == 0.0 ? ahead : Eigen::Vector3d(rot_z(-layout.turn) * ahead);
}

void stand_at_bearings(const Participants& cast, Layout& layout) {
  const auto& [a, b] = cast.manner.bearing;
  if (a == 0.0 && b == 0.0) return;
  const double to_hand = side_sign(cast.side), roots = std::hypot(layout.distance, layout.lateral);
  const double bearing = std::atan2(layout.lateral, layout.distance) + to_hand * a;
  layout.distance = roots * std::cos(bearing);
  layout.lateral = roots * std::sin(bearing);
  layout.turn = to_hand * (a - b);
}

Layout meeting_layout(const Participants& cast, double z, double share, double nearest, double farthest,
                      const Lean& lean) {
  std::array<double, 2> ahead;
  for (const int k : {0, 1})
    ahead[k] = std::clamp(reach_ahead(cast.body[k], cast.side, z, share, lean), nearest, farthest);
  Layout layout;
  layout.distance = ahead[0] + ahead[1];
  if (cast.manner.distance && *cast.manner.distance < layout.distance)
    return meeting_at_distance(cast, z, *cast.manner.distance, lean);
  layout.meet = {ahead[0], 0.0, z};
  if (!cast.manner.rehearsed) meet_between(cast, ahead[0] / layout.distance, layout);
  for (const int k : {0, 1}) layout.lean[k] = lean_to_meet(cast, k, layout, lean, 0.93);
  return layout;
}

Layout meeting_at_distance(const Participants& cast, double z, double distance, const Lean& lean) {
  const double arms = cast.body[0].arm() + cast.body[1].arm();
  Layout layout;
  layout.distance = distance;
  layout.meet = {distance * cast.body[0].arm() / arms, 0.0, z};
  if (!cast.manner.rehearsed) meet_between(cast, cast.body[0].arm() / arms, layout);
  for (const int k : {0, 1}) layout.lean[k] = lean_to_meet(cast, k, layout, lean, 0.96);
  return layout;
}

Draws::Draws(std::uint64_t seed, Task task, int index, double breadth)
    : seed_(seed), task_(to_string(task)), index_(std::to_string(index)), breadth_(breadth) {}

Random Draws::stream(std::string_view quantity) const {
  return {seed_, stream_key({"synthesis", task_, index_, quantity})};
}

void Draws::record(const std::string& quantity, double value) { recorded_[quantity] = fmt::format("{}", value); }

double Draws::uniform(const std::string& quantity, double low, double high, std::optional<double> given) {
  const double value = given ? *given : stream(quantity).uniform(low, high);
  record(quantity, value);
  return value;
}

double Draws::styled(const std::string& quantity, double style, double low, double high) {
  const double share = std::clamp(style + stream(quantity).uniform(-0.2, 0.2), 0.0, 1.0);
  const double wider = share + breadth_ * (share - 0.5);
  const double value = low + (high - low) * (breadth_ == 0.0 ? share : wider);
  record(quantity, value);
  return value;
}

double Draws::spread(const std::string& quantity, const Deciles& deciles) {
  const double u = stream(quantity).uniform();
  const double value = u < 0.5 ? deciles.middle + (u - 0.5) / 0.4 * (deciles.middle - deciles.low)
                               : deciles.middle + (u - 0.5) / 0.4 * (deciles.high - deciles.middle);
  record(quantity, value);
  return value;
}

double Draws::memoryless(const std::string& quantity, double mean) {
  const double value = -mean * std::log1p(-stream(quantity).uniform());
  record(quantity, value);
  return value;
}

bool Draws::chance(const std::string& quantity, double probability, std::optional<bool> given) {
  const bool value = given ? *given : stream(quantity).chance(probability);
  recorded_[quantity] = value ? "yes" : "no";
  return value;
}

}  // namespace duet::synthesis
