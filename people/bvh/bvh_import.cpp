#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "duet/core/require.h"
#include "duet/motion/layouts/joint_layout.h"
#include "duet/motion/phase_proposal.h"
#include "duet/motion/plausibility.h"
#include "duet/people/bvh/bvh.h"
#include "duet/people/bvh/bvh_detection.h"
#include "duet/people/bvh/bvh_kinematics.h"

namespace duet {
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
