#include "duet/robots/human_body.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/core/recording.h"
#include "duet/core/require.h"

namespace duet {
namespace {

// One capsule of an adult of 1.75 m. Its radius grows in proportion to the length that `scale` names: the bone between
// its own joints, or for trunk and head the spine from pelvis to neck.
enum class Scale { kBone, kSpine };

struct Part {
  const char* name;
  const char* region;
  int a, b;
  double begin, end;
  double radius;     // [m] at the reference length
  double reference;  // [m] of the bone, or of the spine
  Scale scale;
};

constexpr double kSpine = 0.51;  // pelvis - spine1 - spine2 - spine3 - neck of the reference adult [m]

// Radii: about half the mean of breadth and depth of an adult's segments, to 5 mm, chosen by hand. The trunk is one
// column along the spine and two across at hips and shoulders. Shoulders count as ISO/TS 15066's "back and shoulders".
constexpr Part kParts[] = {
    {"head", "head", kNeck, kHead, 0.9, 1.7, 0.095, kSpine, Scale::kSpine},
    {"neck", "neck", kNeck, kHead, 0.0, 0.8, 0.060, kSpine, Scale::kSpine},
    {"upper_chest", "chest", kSpine3, kNeck, 0.0, 0.5, 0.115, kSpine, Scale::kSpine},
    {"lower_chest", "chest", kSpine2, kSpine3, 0.0, 1.0, 0.120, kSpine, Scale::kSpine},
    {"abdomen", "abdomen", kSpine1, kSpine2, 0.0, 1.0, 0.120, kSpine, Scale::kSpine},
    {"lower_trunk", "pelvis", kPelvis, kSpine1, 0.0, 1.0, 0.120, kSpine, Scale::kSpine},
    {"left_pelvis", "pelvis", kPelvis, kLeftHip, 0.0, 1.0, 0.100, kSpine, Scale::kSpine},
    {"right_pelvis", "pelvis", kPelvis, kRightHip, 0.0, 1.0, 0.100, kSpine, Scale::kSpine},
    {"left_side_chest", "chest", kSpine3, kLeftCollar, 0.0, 1.0, 0.090, kSpine, Scale::kSpine},
    {"right_side_chest", "chest", kSpine3, kRightCollar, 0.0, 1.0, 0.090, kSpine, Scale::kSpine},
    {"left_shoulder", "back", kLeftCollar, kLeftShoulder, 0.0, 1.0, 0.065, kSpine, Scale::kSpine},
    {"right_shoulder", "back", kRightCollar, kRightShoulder, 0.0, 1.0, 0.065, kSpine, Scale::kSpine},
    {"left_upper_arm", "upper_arm", kLeftShoulder, kLeftElbow, 0.0, 1.0, 0.050, 0.29, Scale::kBone},
    {"right_upper_arm", "upper_arm", kRightShoulder, kRightElbow, 0.0, 1.0, 0.050, 0.29, Scale::kBone},
    {"left_forearm", "forearm", kLeftElbow, kLeftWrist, 0.0, 1.0, 0.040, 0.25, Scale::kBone},
    {"right_forearm", "forearm", kRightElbow, kRightWrist, 0.0, 1.0, 0.040, 0.25, Scale::kBone},
    {"left_hand", "hand", kLeftWrist, kLeftHand, 0.3, 1.6, 0.030, 0.085, Scale::kBone},
    {"right_hand", "hand", kRightWrist, kRightHand, 0.3, 1.6, 0.030, 0.085, Scale::kBone},
    {"left_thigh", "thigh", kLeftHip, kLeftKnee, 0.0, 1.0, 0.075, 0.40, Scale::kBone},
    {"right_thigh", "thigh", kRightHip, kRightKnee, 0.0, 1.0, 0.075, 0.40, Scale::kBone},
    {"left_shin", "shin", kLeftKnee, kLeftAnkle, 0.0, 1.0, 0.055, 0.42, Scale::kBone},
    {"right_shin", "shin", kRightKnee, kRightAnkle, 0.0, 1.0, 0.055, 0.42, Scale::kBone},
    {"left_foot", "foot", kLeftAnkle, kLeftToe, 0.0, 1.3, 0.035, 0.135, Scale::kBone},
    {"right_foot", "foot", kRightAnkle, kRightToe, 0.0, 1.3, 0.035, 0.135, Scale::kBone},
};

struct RegionStiffness {
  std::string_view region;
  double newton_per_millimetre;
};
// ISO/TS 15066's effective spring constants as public tables print them. A head capsule takes the face's, which is
// softer than the skull; the foot, which the standard leaves out, the shin's.
constexpr RegionStiffness kStiffness[] = {{"head", 75.0}, {"neck", 50.0},   {"chest", 25.0},     {"abdomen", 10.0},
                                          {"back", 35.0}, {"pelvis", 25.0}, {"upper_arm", 30.0}, {"forearm", 40.0},
                                          {"hand", 75.0}, {"thigh", 50.0},  {"shin", 60.0},      {"foot", 60.0}};

}  // namespace

ContactCompliance default_skin(std::string_view region) {
  for (const RegionStiffness& entry : kStiffness)
    if (entry.region == region) return {.stiffness = 1000.0 * entry.newton_per_millimetre};
  throw std::invalid_argument(fmt::format("human body: no region '{}'", region));
}

std::array<Eigen::Vector3d, 2> HumanCapsule::ends(const Eigen::Ref<const Eigen::Matrix3Xd>& joints) const {
  const Eigen::Vector3d a = joints.col(joint_a), bone = joints.col(joint_b) - a;
  return {a + begin * bone, a + end * bone};
}

HumanBody make_human_body(const std::array<double, 24>& bone_lengths) {
  for (int j = 1; j < kSmplJoints; ++j)
    require(std::isfinite(bone_lengths[j]) && bone_lengths[j] > 0.0,
            "human body: expected a finite, positive length of the bone from '{}' to '{}', found {}", kSmplNames[j],
            kSmplNames[kSmplParents[j]], bone_lengths[j]);
  const double spine = bone_lengths[kSpine1] + bone_lengths[kSpine2] + bone_lengths[kSpine3] + bone_lengths[kNeck];
  HumanBody body;
  for (const Part& part : kParts) {
    const double length = part.scale == Scale::kSpine ? spine : bone_lengths[part.b];
    body.capsules.push_back({.name = part.name,
                             .region = part.region,
                             .joint_a = part.a,
                             .joint_b = part.b,
                             .radius = part.radius * length / part.reference,
                             .begin = part.begin,
                             .end = part.end,
                             .skin = default_skin(part.region)});
  }
  return body;
}

}  // namespace duet
