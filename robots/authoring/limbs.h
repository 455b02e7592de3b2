// Legs, arms, waist and neck of a URDF, from its tree and the places and axes of its hinges at zero: names are not
// looked at. The root looks along x, left is +y, z is up. Pure functions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/robots/urdf.h"

namespace duet {

// Joints are indices in UrdfModel::joints, links in UrdfModel::links. -1: none.
struct Limbs {
  std::array<std::vector<int>, 2> legs,
      arms;  // hinges from the trunk outwards, left before right; as many on each side
  std::array<int, 2> knee = {-1, -1}, ankle = {-1, -1};  // hinges that bend; the ankle's first
  std::array<int, 2> hip_pitch = {-1, -1}, elbow = {-1, -1};
  std::vector<int> waist, neck;
  std::vector<int> rest;  // joints that can move and are none of these: fingers, sliders, joints that mimic
  int base = 0;           // link: the root, or the only child of a massless one through a floating joint
  int pelvis = 0;         // link that carries the legs
  int trunk = 0;          // link that carries the arms; without arms, the base
};

Limbs find_limbs(const UrdfModel& urdf);

// Poses of all links in the base's frame; `angles`: of each joint of the URDF [rad] or [m].
std::vector<Pose> poses_in_base(const UrdfModel& urdf, int base, const std::vector<double>& angles);

// The link that moves a link: itself, or the one to which it is rigid, given the joints that move.
int carrier_of(const UrdfModel& urdf, int link, const std::vector<bool>& moves);

// Angles of a standing pose: all at zero, or as near as their limits let; straight legs a little bent, arms that are
// stretched out turned down.
std::vector<double> standing_angles(const UrdfModel& urdf, const Limbs& limbs);

// "roll", "pitch" or "yaw" by the axis at zero, or "roll and yaw" for one between.
std::string turn_of(const UrdfModel& urdf, const Limbs& limbs, int joint);

}  // namespace duet
