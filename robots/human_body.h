// The human partner as a kinematic body of capsules between SMPL-24 joints, with body-part regions (the regions follow
// ISO/TS 15066's list as far as capsules tell them apart). Sized from bone lengths.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// The skin of the solid partner: a spring and a damper along the normal of a contact, the same in every engine, so that
// a peak force is a property of the bodies and not of the engine's time step.
struct ContactCompliance {
  double stiffness = 25000.0;  // [N/m]
  double damping = 200.0;      // [N s/m]
};

struct HumanCapsule {
  std::string name = {};    // "left_forearm"
  std::string region = {};  // "head", "neck", "chest", "abdomen", "back", "pelvis", "upper_arm", "forearm", "hand",
                            // "thigh", "shin", "foot"
  int joint_a = 0;          // SMPL-24 joints at its two ends
  int joint_b = 0;
  double radius = 0.0;  // [m]
  // The axis runs from a + begin (b - a) to a + end (b - a): a head reaches beyond its joint, a hand beyond the
  // knuckles.
  double begin = 0.0;
  double end = 1.0;
  ContactCompliance skin = {};

  // Ends of the axis for joint positions (3, 24). [m], in their frame.
  [[nodiscard]] std::array<Eigen::Vector3d, 2> ends(const Eigen::Ref<const Eigen::Matrix3Xd>& joints) const;
};

struct HumanBody {
  std::vector<HumanCapsule> capsules;
};

// The skin of a region: stiffness from the effective spring constants of ISO/TS 15066 (docs/deviations.md), damping the
// same everywhere. Throws std::invalid_argument for an unknown region.
ContactCompliance default_skin(std::string_view region);

// `bone_lengths` as from duet::bone_lengths (entry j: joint j to its parent). Throws std::invalid_argument naming a
// bone that is not finite or not positive.
HumanBody make_human_body(const std::array<double, 24>& bone_lengths);

}  // namespace duet
