// A URDF as the loader needs it: links with inertia and joints in a tree, checked. Meshes, materials and transmissions
// are not looked at, simple collision shapes only to propose where a foot's sole is.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/robot_state.h"

namespace duet {

enum class UrdfJointType { kFixed, kRevolute, kContinuous, kPrismatic, kFloating, kPlanar };
const char* to_string(UrdfJointType type);

// A box, sphere or cylinder of a link's collision elements, by the box around it.
struct UrdfBox {
  Pose X_LB;                                       // its centre
  Eigen::Vector3d half = Eigen::Vector3d::Zero();  // half its sides [m]
};

struct UrdfLink {
  std::string name;
  double mass = 0.0;                                  // [kg], 0 where the link has no inertial element
  Eigen::Vector3d com = Eigen::Vector3d::Zero();      // p_LCom [m]
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about the centre of mass, axes of L [kg m^2]
  std::vector<UrdfBox> boxes;                         // of its collision elements; meshes have none
};

struct UrdfJoint {
  std::string name;
  UrdfJointType type = UrdfJointType::kFixed;
  int parent = 0;  // links
  int child = 0;
  Pose X_PC;                                        // child in parent at q = 0
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  // in the child, unit
  double lower = 0.0, upper = 0.0;                  // [rad] or [m]; +-2 pi for a continuous joint
  double effort = 0.0, velocity = 0.0;              // 0 where a continuous joint gives none
  double damping = 0.0, friction = 0.0;             // of <dynamics> [N m s/rad, N m]
  std::string mimics;                               // joint whose angle it follows; "": none
  double mimic_factor = 1.0, mimic_offset = 0.0;    // its angle: factor times the other's, plus offset
};

struct UrdfModel {
  std::vector<UrdfLink> links;    // links[0] is the root; parents come first
  std::vector<UrdfJoint> joints;  // joints[i] moves links[i + 1]
};

// Throws InputError naming file, element, expected and found. Thread-safe.
UrdfModel parse_urdf(const std::string& text, const std::string& file);

// How deep an XML text nests, told before a parser sees it: TinyXML goes down by recursion, so that a file that nests
// without end would end the program. Thread-safe.

// A URDF nests 5 deep, with the extensions of simulators about 10.
inline constexpr int kMostXmlDepth = 100;

// Throws InputError with file and line for elements that nest deeper than kMostXmlDepth, for a tag or comment without
// its end and for a '<' inside of a tag (which XML forbids, and which could hide an element from this count).
void check_xml_nesting(std::string_view text, const std::string& file);

}  // namespace duet
