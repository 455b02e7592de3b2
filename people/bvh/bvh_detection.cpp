#include "duet/people/bvh/bvh_detection.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "duet/core/require.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/layouts/joint_layout.h"
#include "duet/motion/plausibility.h"
#include "duet/people/bvh/bvh.h"

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

namespace {

struct Conversion {
  Eigen::Quaterniond R_WF;  // from the file's axes to W
  double metres_per_unit = 1.0;
  std::array<int, 2> first_frame = {0, 0};  // of A, of B
  double rate_hz = 0.0;
  double output_rate_hz = 0.0;
  int output_frames = 0;
};

std::string file_name(const std::string& path) { return std::filesystem::path(path).filename().string(); }

void put_positions(HumanMotion& motion, int t, const SmplPositions& positions, const Conversion& to) {
  motion.joints.frame(t) = to.metres_per_unit * (to.R_WF.toRotationMatrix() * positions);
}

// Rotations are counted from the hierarchy's own posture turned to face +x, the convention of docs/conventions.md.
Eigen::Quaterniond reference_facing(const BvhPerson& person, const Conversion& to) {
  PointTracks rest(1, kSmplJoints);
  rest.frame(0) = to.R_WF.toRotationMatrix() *
                  smpl_positions(person.skeleton, global_poses(person.bvh, zero_local_poses(person.bvh)));
  return yaw_rotation(heading(rest, 0));
}

HumanMotion convert(const BvhPerson& person, int first_frame, const Conversion& to) {
  HumanMotion motion{
      .rate_hz = to.output_rate_hz, .joints = PointTracks(to.output_frames, kSmplJoints), .rotations = {}};
  motion.rotations.reserve(static_cast<std::size_t>(to.output_frames) * kSmplJoints);
  const Eigen::Quaterniond R_FR = to.R_WF.conjugate() * reference_facing(person, to);
  for (int t = 0; t < to.output_frames; ++t) {
    const double index = first_frame + t * (to.rate_hz / to.output_rate_hz);
    const std::vector<Pose> poses = global_poses(person.bvh, local_poses_at(person.bvh, index));
    put_positions(motion, t, smpl_positions(person.skeleton, poses), to);
    for (const int side : {0, 1})
      if (person.skeleton.lacks_toe[side]) put_toe(motion.joints.frame(t), side);
    for (const BvhPoint& point : person.skeleton.points)
      motion.rotations.push_back((to.R_WF * poses[point.rotation].R * R_FR).normalized());
  }
  return motion;
}

double lowest_toe(const HumanMotion& motion) {
  double lowest = motion.joints.at(0, kLeftToe).z();
  for (int t = 0; t < motion.frames(); ++t)
    for (const int toe : {kLeftToe, kRightToe}) lowest = std::min(lowest, motion.joints.at(t, toe).z());
  return lowest;
}

int output_frames(const Bvh& bvh, int frames, double rate_hz, double output_rate_hz) {
  try {
    return resampled_frames(frames, rate_hz, output_rate_hz);
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("'{}': {}", bvh.name, error.what()));
  }
}

Conversion plan(const BvhPerson& a, const BvhPerson& b, const BvhOptions& options, std::vector<std::string>& verdict) {
  require(std::isfinite(options.output_rate_hz) && options.output_rate_hz > 0.0,
          "BVH import: expected a positive output rate, found {} Hz", options.output_rate_hz);
  const BvhFinding<UpAxis> up = find_up_axis(a, b, options);
  const BvhFinding<std::array<int, 2>> first = find_first_frames(a, b, up.value, options);
  const BvhFinding<double> rate = find_rate(a, b, options);
  const BvhFinding<double> unit = find_metres_per_unit(a, b, options);
  const std::array<int, 2> lengths = {a.bvh.frames - first.value[0], b.bvh.frames - first.value[1]};
  const int frames = std::min(lengths[0], lengths[1]);
  if (frames < 2)
    throw InputError(fmt::format("'{}': expected at least 2 frames of motion, found {}", a.bvh.name, frames));
  verdict = {fmt::format("joint names: {} ('{}'), {} ('{}')", a.skeleton.naming, file_name(a.bvh.name),
                         b.skeleton.naming, file_name(b.bvh.name)),
             up.sentence, first.sentence, rate.sentence, unit.sentence};
  if (lengths[0] != lengths[1])
    verdict.push_back(
        fmt::format("length: '{}' has {} frames and '{}' {}: the "
                    "first {} of both are taken",
                    file_name(a.bvh.name), lengths[0], file_name(b.bvh.name), lengths[1], frames));
  for (const BvhPerson* person : {&a, &b})
    for (const auto* notes : {&person->bvh.notes, &person->skeleton.notes})
      for (const std::string& note : *notes)
        verdict.push_back(fmt::format("'{}': {}", file_name(person->bvh.name), note));
  const Eigen::Quaterniond R_WF(
      Eigen::AngleAxisd(up.value == UpAxis::kY ? 0.5 * std::numbers::pi : 0.0, Eigen::Vector3d::UnitX()));
  Conversion to{.R_WF = R_WF,
                .metres_per_unit = unit.value,
                .first_frame = first.value,
                .rate_hz = rate.value,
                .output_rate_hz = options.output_rate_hz,
                .output_frames = output_frames(a.bvh, frames, rate.value, options.output_rate_hz)};
  if (to.output_frames < 2)
    throw InputError(fmt::format("'{}': {} frames at {:g} Hz are fewer than 2 frames at {:g} Hz", a.bvh.name, frames,
                                 rate.value, options.output_rate_hz));
  verdict.push_back(fmt::format("resampled: {} frames at {:g} Hz -> {} frames at {:g} Hz", frames, rate.value,
                                to.output_frames, options.output_rate_hz));
  return to;
}

std::string stem(const std::string& path) { return std::filesystem::path(path).stem().string(); }

}  // namespace

BvhImport import_bvh_pair(const std::string& path_a, const std::string& path_b, Task task, const BvhOptions& options) {
  return import_bvh_pair(read_bvh(path_a), read_bvh(path_b), task, options);
}

BvhImport import_bvh_pair(const Bvh& bvh_a, const Bvh& bvh_b, Task task, const BvhOptions& options) {
  const BvhPerson a{.bvh = bvh_a, .skeleton = find_smpl_joints(bvh_a, options.skeleton)};
  const BvhPerson b{.bvh = bvh_b, .skeleton = find_smpl_joints(bvh_b, options.skeleton)};
  BvhImport result;
  const Conversion to = plan(a, b, options, result.verdict);
  InteractionClip& clip = result.clip;
  try {
    clip.id = stem(bvh_a.name) + "-" + stem(bvh_b.name);
    clip.task = task;
    clip.a = convert(a, to.first_frame[0], to);
    clip.b = convert(b, to.first_frame[1], to);
    validate(clip);
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("'{}', '{}': {}", bvh_a.name, bvh_b.name, error.what()));
  }
  clip.phases = propose_phases(clip.a, clip.b, task);
  clip.source = {{"format", "BVH"},
                 {"file_a", file_name(bvh_a.name)},
                 {"file_b", file_name(bvh_b.name)},
                 {"metres_per_unit", fmt::format("{}", to.metres_per_unit)},
                 {"source_rate_hz", fmt::format("{}", to.rate_hz)},
                 {"first_frame", fmt::format("{}", to.first_frame[0])},
                 {"phases", "proposed"}};
  result.verdict.push_back(fmt::format("floor: lowest toe joint at {:.3f} m (A) and {:.3f} m (B); heights kept",
                                       lowest_toe(clip.a), lowest_toe(clip.b)));
  result.verdict.push_back(fmt::format("phases: act [{}, {}) of {} frames (proposed)", clip.phases.act_begin,
                                       clip.phases.act_end, clip.frames()));
  const Plausibility found = judge_people(clip);
  for (const auto* sentences : {&found.faults, &found.oddities})
    for (const std::string& sentence : *sentences) result.verdict.push_back("not as expected: " + sentence);
  return result;
}

}  // namespace duet
