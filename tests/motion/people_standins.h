// Two synthesised people as data sets of others would hold them: the columns of a skeleton, units and axes. The writers
// of whole files stand in people_files.h.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <string>
#include <vector>

#include "duet/motion/layouts/joint_recipes.h"
#include "duet/motion/people/raw_people.h"
#include "duet/motion/synthesis/synthesis.h"

namespace duet::test {

// Some frames of a handshake, from a second before the hands meet.
inline InteractionClip standin_clip(int frames, double rate_hz, Task task = Task::kHandshake) {
  InteractionClip clip = synthesize(task, {.seed = 11, .rate_hz = rate_hz});
  const int begin = std::max(0, std::min(clip.phases.act_begin, clip.frames() - frames));
  clip.a = slice(clip.a, begin, begin + frames);
  clip.b = slice(clip.b, begin, begin + frames);
  clip.phases = {.act_begin = 0, .act_end = frames};
  clip.contacts.clear();
  return clip;
}

// Columns of a skeleton for SMPL joints in W: those that are SMPL joints, the face, and the rest beside the wrists.
inline Eigen::Matrix3Xd standin_columns(const JointLayout& layout, const PointTracks::ConstFrame& smpl) {
  const auto size = static_cast<int>(layout.names.size());
  const Eigen::Vector3d left =
      (smpl.col(kLeftHip) - smpl.col(kRightHip) + smpl.col(kLeftShoulder) - smpl.col(kRightShoulder)).normalized();
  const Eigen::Vector3d ahead(left.y(), -left.x(), 0.0);
  Eigen::Matrix3Xd columns(3, size);
  for (int k = 0; k < size; ++k) columns.col(k) = smpl.col(kRightWrist) + 0.002 * (k + 1) * Eigen::Vector3d::UnitZ();
  const BodyColumns body = body_columns(layout.name, layout.names);
  const auto put = [&](int column, const Eigen::Vector3d& p) {
    if (column >= 0) columns.col(column) = p;
  };
  put(body.side[0][kEarPart], smpl.col(kHead) + 0.07 * left);
  put(body.side[1][kEarPart], smpl.col(kHead) - 0.07 * left);
  put(body.nose, smpl.col(kHead) + 0.1 * ahead);
  put(body.head_top, smpl.col(kHead) + Eigen::Vector3d(0, 0, 0.15));
  if (body.trunk.size() == 1) put(body.trunk[0], smpl.col(kSpine2));
  for (int joint = 0; joint < kSmplJoints; ++joint) {
    const JointRecipe& recipe = layout.smpl[joint];
    if (recipe.reach != 0.0 || recipe.ahead != 0.0) continue;
    for (const JointRecipe::Part& part : recipe.parts)
      if (part.column < size &&
          (recipe.parts.size() == 1 || layout.names[part.column].find("foot_") != std::string::npos))
        columns.col(part.column) = smpl.col(joint);
  }
  return columns;
}

inline PointTracks standin_columns(const JointLayout& layout, const HumanMotion& motion) {
  PointTracks columns(motion.frames(), static_cast<int>(layout.names.size()));
  for (int t = 0; t < motion.frames(); ++t) columns.frame(t) = standin_columns(layout, motion.joints.frame(t));
  return columns;
}

// Axes, unit and place of a file.
struct FileWorld {
  Eigen::Matrix3d M = Eigen::Matrix3d::Identity();  // p_F = M (p_W - p)
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
};
inline FileWorld y_up(double units_per_metre = 1.0) {
  FileWorld world;
  world.M << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  world.M *= units_per_metre;
  return world;
}

inline PointTracks in_file(PointTracks points, const FileWorld& world) {
  for (int t = 0; t < points.frames(); ++t) points.frame(t) = world.M * (points.frame(t).colwise() - world.p);
  return points;
}

inline RawPeople standin_people(const InteractionClip& clip, const JointLayout& layout, const FileWorld& world = {}) {
  RawPeople people{.id = "standin", .name = "standin.npz", .layout = &layout, .joints = {}};
  people.joints = {in_file(standin_columns(layout, clip.a), world), in_file(standin_columns(layout, clip.b), world)};
  people.rate_hz = clip.rate_hz();
  people.task = clip.task;
  return people;
}

// The motion that a reader should make of such a file: the SMPL joints of the skeleton's columns in W, at 50 Hz.
inline HumanMotion expected_motion(const HumanMotion& motion, const JointLayout& layout, double rate_hz = 50.0) {
  const HumanMotion columns =
      resample({.rate_hz = motion.rate_hz, .joints = standin_columns(layout, motion), .rotations = {}}, rate_hz);
  HumanMotion smpl{.rate_hz = rate_hz, .joints = PointTracks(columns.frames(), kSmplJoints), .rotations = {}};
  for (int t = 0; t < columns.frames(); ++t) make_smpl(layout, columns.joints.frame(t), true, smpl.joints.frame(t));
  return smpl;
}

// The farthest that a joint of either person is from where it should be, once the two clips stand in the same place:
// the file's axes may leave a turn about z and a shift. [m]
inline double worst_distance(const InteractionClip& found, const InteractionClip& expected) {
  if (found.frames() != expected.frames()) return 1e9;
  double worst = 0.0;
  for (const auto& [a, b] : {std::pair{&found.a, &expected.a}, {&found.b, &expected.b}})
    for (int t = 0; t < found.frames(); ++t)
      worst = std::max(worst, (a->joints.frame(t) - b->joints.frame(t)).colwise().norm().maxCoeff());
  return worst;
}

inline InteractionClip expected_clip(const InteractionClip& clip, const JointLayout& layout, double rate_hz = 50.0) {
  InteractionClip expected = clip;
  expected.a = expected_motion(clip.a, layout, rate_hz);
  expected.b = expected_motion(clip.b, layout, rate_hz);
  return expected;
}

}  // namespace duet::test
