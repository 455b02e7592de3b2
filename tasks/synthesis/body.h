// A body for synthesis: the 24 joints' offsets from their parents in the rest pose (standing, arms out to the sides;
// x forward, y left, z up), scaled from anthropometric ratios. [m]
#pragma once

#include <Eigen/Core>
#include <array>

#include "duet/core/skeleton.h"

namespace duet::synthesis {

// Factors on the mean proportions, 1 = mean.
struct Proportions {
  double legs = 1.0;  // the trunk takes up what the legs leave, so that the stature holds
  double arms = 1.0;
  double shoulders = 1.0;
  double hips = 1.0;
};

struct Body {
  double height = 0.0;  // stature, top of the head, legs straight
  std::array<Eigen::Vector3d, kSmplJoints> offset;
  double thigh = 0.0;
  double shank = 0.0;
  double upper_arm = 0.0;
  double forearm = 0.0;
  double hand = 0.0;          // wrist to hand joint
  double torso_radius = 0.0;  // of the capsule round the spine, pelvis to neck
  double stand_height = 0.0;  // of the pelvis, knees a little bent

  [[nodiscard]] double leg() const { return thigh + shank; }
  [[nodiscard]] double arm() const { return upper_arm + forearm + hand; }
  [[nodiscard]] double ankle_height() const;
  [[nodiscard]] double toe_height() const;
};

Body make_body(double height, const Proportions& proportions);

}  // namespace duet::synthesis
