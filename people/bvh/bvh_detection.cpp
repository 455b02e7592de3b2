#include "duet/people/bvh/bvh_detection.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "duet/core/require.h"
#include "duet/motion/plausibility.h"
#include "duet/people/bvh/bvh_kinematics.h"

namespace duet {
namespace {

constexpr double kWholeRate = 5e-4;                                 // relative; 29.97 Hz is 1e-3 from 30 Hz
constexpr double kSameRate = 1e-6;                                  // relative; of digits that differ in the last place
constexpr double kLowestFrameRate = 0.01, kHighestFrameRate = 1e5;  // [Hz]
constexpr double kHorizontalSine = 0.34;                            // arms within 20 degrees of horizontal
constexpr double kStraightArm = 0.95;                               // shoulder to wrist, of the arm's length
constexpr double kJump = 5.0;                                       // first step of the motion, in steps that follow
constexpr double kJumpOfStature = 0.05;                             // and never less than this

SmplPositions positions_at(const BvhPerson& person, int frame) {
  return smpl_positions(person.skeleton, global_poses(person.bvh, local_poses(person.bvh, frame)));
}

Eigen::Vector3d mean_upright(const BvhPerson& person) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int t = 0; t < person.bvh.frames; ++t) {
    const SmplPositions p = positions_at(person, t);
    sum += (p.col(kHead) - 0.5 * (p.col(kLeftAnkle) + p.col(kRightAnkle))).normalized();
  }
  return sum / person.bvh.frames;
}

bool has_horizontal_arms(const SmplPositions& p, UpAxis up) {
  for (const auto& [shoulder, elbow, wrist] :
       {std::array{kLeftShoulder, kLeftElbow, kLeftWrist}, std::array{kRightShoulder, kRightElbow, kRightWrist}}) {
    const Eigen::Vector3d arm = p.col(wrist) - p.col(shoulder);
    const double length = (p.col(elbow) - p.col(shoulder)).norm() + (p.col(wrist) - p.col(elbow)).norm();
    if (std::abs(arm[up == UpAxis::kY ? 1 : 2]) > kHorizontalSine * arm.norm()) return false;
    if (arm.norm() < kStraightArm * length) return false;
  }
  return true;
}

double largest_step(const SmplPositions& from, const SmplPositions& to) {
  return (to - from).colwise().norm().maxCoeff();
}

bool has_t_pose(const BvhPerson& person, UpAxis up) {
  if (person.bvh.frames < 3) return false;
  const SmplPositions first = positions_at(person, 0);
  const SmplPositions second = positions_at(person, 1);
  const double jump = largest_step(first, second);
  return has_horizontal_arms(first, up) && jump > kJumpOfStature * stature(first) &&
         jump > kJump * largest_step(second, positions_at(person, 2));
}

double rate_of(const Bvh& bvh) {
  const double rate_hz = 1.0 / bvh.frame_time;
  if (!(rate_hz >= kLowestFrameRate && rate_hz <= kHighestFrameRate))
    throw InputError(
        fmt::format("'{}': a frame time of {} s is out of range "
                    "({:g} to {:g} Hz); state the rate",
                    bvh.name, bvh.frame_time, kLowestFrameRate, kHighestFrameRate));
  const double whole = std::round(rate_hz);
  return whole > 0.0 && std::abs(rate_hz - whole) <= kWholeRate * whole ? whole : rate_hz;
}

double rest_stature(const BvhPerson& person) {
  return stature(smpl_positions(person.skeleton, global_poses(person.bvh, zero_local_poses(person.bvh))));
}

}  // namespace

BvhFinding<UpAxis> find_up_axis(const BvhPerson& a, const BvhPerson& b, const BvhOptions& options) {
  if (options.up) return {*options.up, fmt::format("up axis: {} (as told)", *options.up == UpAxis::kY ? "y" : "z")};
  const Eigen::Vector3d mean = 0.5 * (mean_upright(a) + mean_upright(b));
  if (!(mean.y() >= kUprightCosine || mean.z() >= kUprightCosine))  // also where it is not a number
    throw InputError(
        fmt::format("'{}': cannot tell the up axis: the heads are above the ankles along ({:.2f}, {:.2f}, {:.2f}), "
                    "expected +y or +z; state the up axis",
                    a.bvh.name, mean.x(), mean.y(), mean.z()));
  const UpAxis up = mean.y() >= kUprightCosine ? UpAxis::kY : UpAxis::kZ;
  return {up, fmt::format("up axis: {} (heads are above ankles along ({:.2f}, {:.2f}, {:.2f}))",
                          up == UpAxis::kY ? "y" : "z", mean.x(), mean.y(), mean.z())};
}

BvhFinding<double> find_rate(const BvhPerson& a, const BvhPerson& b, const BvhOptions& options) {
  if (options.rate_hz) {
    require(std::isfinite(*options.rate_hz) && *options.rate_hz > 0.0,
            "BVH import: expected a positive rate, found {} Hz", *options.rate_hz);
    return {*options.rate_hz,
            fmt::format("rate: {} Hz (as told; frame time {} s)", *options.rate_hz, a.bvh.frame_time)};
  }
  const double rate_hz = rate_of(a.bvh);
  if (std::abs(rate_hz - rate_of(b.bvh)) > kSameRate * rate_hz)
    throw InputError(
        fmt::format("'{}' has a frame time of {} s and '{}' {} s: "
                    "expected two people at the same rate; "
                    "state the rate",
                    a.bvh.name, a.bvh.frame_time, b.bvh.name, b.bvh.frame_time));
  return {rate_hz, fmt::format("rate: {:g} Hz (frame time {} s)", rate_hz, a.bvh.frame_time)};
}

BvhFinding<std::array<int, 2>> find_first_frames(const BvhPerson& a, const BvhPerson& b, UpAxis up,
                                                 const BvhOptions& options) {
  if (options.drop_t_pose)
    return *options.drop_t_pose ? BvhFinding<std::array<int, 2>>{{1, 1}, "frame 0 dropped (as told)"}
                                : BvhFinding<std::array<int, 2>>{{0, 0}, "frame 0 kept (as told)"};
  const bool in_a = has_t_pose(a, up);
  const bool in_b = has_t_pose(b, up);
  if (in_a && in_b)
    return {{1, 1},
            "frame 0 dropped: an added T pose (straight horizontal arms, then "
            "a jump)"};
  if (!in_a && !in_b) return {{0, 0}, "frame 0 kept: not an added T pose"};
  const std::string whose =
      fmt::format("an added T pose of '{}' (straight horizontal arms, then a jump)", (in_a ? a : b).bvh.name);
  const int more = (in_a ? a : b).bvh.frames - (in_a ? b : a).bvh.frames;
  if (more == 1) return {{in_a ? 1 : 0, in_b ? 1 : 0}, "frame 0 dropped from one file: " + whose};
  return {{1, 1}, "frame 0 dropped: " + whose};
}

BvhFinding<double> find_metres_per_unit(const BvhPerson& a, const BvhPerson& b, const BvhOptions& options) {
  const double mean = 0.5 * (rest_stature(a) + rest_stature(b));
  if (options.metres_per_unit) {
    const double metres = *options.metres_per_unit;
    require(std::isfinite(metres) && metres > 0.0, "BVH import: expected a positive unit of length, found {} m",
            metres);
    return {metres, fmt::format("unit: {} m (as told; head to ankle {:.2f} m)", metres, metres * mean)};
  }
  for (const LengthUnit& unit : kLengthUnits)
    if (const double length = mean * unit.metres; kShortestPerson <= length && length <= kTallestPerson)
      return {unit.metres, fmt::format("unit: {} m, {} (mean bone length from head to ankle {:.4g} units = {:.2f} m)",
                                       unit.metres, unit.name, mean, length)};
  throw InputError(
      fmt::format("'{}': cannot tell the unit of length: the bones from head to ankle measure {:.4g} units, which is "
                  "{} to {} m in none of metre, CMU unit, inch, centimetre, millimetre; state the metres per unit",
                  a.bvh.name, mean, kShortestPerson, kTallestPerson));
}

}  // namespace duet
