#include "duet/retarget/pair_terms.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "duet/core/recording.h"
#include "duet/robots/human_body.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

struct RobotSphere {
  int shape = 0;
  double radius = 0.0;
  bool arm = false, trunk = false;  // forearm or hand; torso, head or pelvis; else a thigh
};

struct HumanSphere {
  double radius = 0.0;
  bool arm = false, hip = false;  // hip: lowest part of the trunk, hips and thighs
};

// Links of `robot` as links of the chain; -1 for those of the legs.
std::vector<int> chain_links(const RobotModel& robot, const UprightChain& upright) {
  std::vector<int> links(robot.links.size(), -1);
  links[0] = 1;
  for (std::size_t j = 1; j < upright.robot_joint.size(); ++j)
    links[upright.robot_joint[j] + 1] = static_cast<int>(j) + 1;
  return links;
}

// A chain's link may be turned against the model's (its hinge lies along a coordinate axis).
Eigen::Matrix3d turn_of(const RobotModel& robot, const UprightChain& upright, int link) {
  if (link == 0) return Eigen::Matrix3d::Identity();
  for (std::size_t j = 1; j < upright.robot_joint.size(); ++j) {
    if (upright.robot_joint[j] + 1 != link) continue;
    const Eigen::Vector3d& axis = robot.links[link].axis;
    if (axis == Eigen::Vector3d(Eigen::Vector3d::Unit(upright.chain.joints[j].axis))) break;
    return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), axis).toRotationMatrix();
  }
  return Eigen::Matrix3d::Identity();
}

std::vector<RobotSphere> add_robot_spheres(const RobotModel& robot, UprightChain& upright, BodySpheres& out) {
  const std::vector<int> links = chain_links(robot, upright);
  std::vector<RobotSphere> spheres;
  Kinematics standing(robot);
  standing.update(Pose{}, robot.neutral);
  for (std::size_t i = 0; i < robot.shapes.size(); ++i) {
    const RobotShape& shape = robot.shapes[i];
    const bool arm = shape.region == "hand" || shape.region == "forearm";
    const bool trunk = shape.region == "torso" || shape.region == "head" || shape.region == "pelvis";
    if (shape.region == "thigh") {  // legs are solved later: as they hang from the planned base in the neutral pose
      out.robot_point.push_back(static_cast<int>(upright.chain.points.size()));
      upright.chain.points.push_back({0, standing.shape_position(static_cast<int>(i))});
      spheres.push_back({static_cast<int>(i), shape.radius, false, false});
    }
    if (links[shape.link] < 0 || (!arm && !trunk)) continue;
    const bool two = trunk && shape.half_length > shape.radius;
    for (const double along : two ? std::vector<double>{-0.6, 0.6} : std::vector<double>{0.0}) {
      const Eigen::Vector3d p = shape.X_LS * Eigen::Vector3d(0.0, 0.0, along * shape.half_length);
      out.robot_point.push_back(static_cast<int>(upright.chain.points.size()));
      upright.chain.points.push_back({links[shape.link], turn_of(robot, upright, shape.link).transpose() * p});
      spheres.push_back({static_cast<int>(i), shape.radius, arm, trunk});
    }
  }
  return spheres;
}

std::vector<HumanSphere> add_human_spheres(const HumanMotion& partner, BodySpheres& out) {
  constexpr std::array<const char*, 6> kTrunk = {"head",    "upper_chest",     "lower_chest",
                                                 "abdomen", "left_side_chest", "right_side_chest"};
  constexpr std::array<const char*, 5> kHips = {"lower_trunk", "left_pelvis", "right_pelvis", "left_thigh",
                                                "right_thigh"};
  constexpr std::array<const char*, 4> kArms = {"left_forearm", "right_forearm", "left_hand", "right_hand"};
  const HumanBody body = make_human_body(bone_lengths(partner));
  std::vector<HumanSphere> spheres;
  std::vector<const HumanCapsule*> capsules;
  for (const HumanCapsule& capsule : body.capsules) {
    bool trunk = false, arm = false, hip = false;
    for (const char* name : kTrunk) trunk = trunk || capsule.name == name;
    for (const char* name : kArms) arm = arm || capsule.name == name;
    for (const char* name : kHips) hip = hip || capsule.name == name;
    if (!trunk && !arm && !hip) continue;
    capsules.push_back(&capsule);
    spheres.push_back({capsule.radius, arm, hip});
    // A forearm's sphere sits at its elbow and a hand's beyond its wrist: each moves with one offset.
    out.human_offset.push_back(arm ? human_offset_of(capsule.joint_a) : -1);
  }
  out.human = PointTracks(partner.frames(), static_cast<int>(spheres.size()));
  for (int t = 0; t < partner.frames(); ++t) {
    for (std::size_t i = 0; i < spheres.size(); ++i) {
      const std::array<Eigen::Vector3d, 2> ends = capsules[i]->ends(partner.joints.frame(t));
      const bool elbow = human_offset_of(capsules[i]->joint_a) == 2 || human_offset_of(capsules[i]->joint_a) == 3;
      out.human.at(t, static_cast<int>(i)) = elbow ? ends[0] : Eigen::Vector3d(0.5 * (ends[0] + ends[1]));
    }
  }
  return spheres;
}

bool may_touch(const RobotModel& robot, int a, int b) {
  for (const auto& [first, second] : robot.self_collision)
    if ((first == a && second == b) || (first == b && second == a)) return true;
  return false;
}

}  // namespace

BodySpheres make_body_spheres(const RobotModel& robot, UprightChain& chain, const HumanMotion& partner) {
  BodySpheres out;
  const std::vector<RobotSphere> robots = add_robot_spheres(robot, chain, out);
  const std::vector<HumanSphere> humans = add_human_spheres(partner, out);
  const int first = static_cast<int>(robots.size());
  for (int a = 0; a < first; ++a) {
    const auto is_thigh = [&](int i) { return !robots[i].arm && !robots[i].trunk; };
    for (int b = a + 1; b < first; ++b)
      if (may_touch(robot, robots[a].shape, robots[b].shape) && !(is_thigh(a) && is_thigh(b)))
        out.pairs.push_back({a, b, robots[a].radius + robots[b].radius});
    for (int h = 0; h < static_cast<int>(humans.size()); ++h)
      if (is_thigh(a) ? humans[h].hip : robots[a].trunk || !humans[h].arm)
        out.pairs.push_back({a, first + h, robots[a].radius + humans[h].radius});
  }
  return out;
}

namespace {

struct Arm {
  int collar, shoulder, elbow, wrist, hand;
};
constexpr Arm kArms[] = {{kLeftCollar, kLeftShoulder, kLeftElbow, kLeftWrist, kLeftHand},
                         {kRightCollar, kRightShoulder, kRightElbow, kRightWrist, kRightHand}};

// `p` at `length` from `center`; where the two coincide, towards `fallback`.
Eigen::Vector3d at_distance(const Eigen::Vector3d& center, const Eigen::Vector3d& p, double length,
                            const Eigen::Vector3d& fallback) {
  Eigen::Vector3d d = p - center;
  if (d.norm() < 1e-9) d = fallback;
  return center + length * d.normalized();
}

// The elbow nearest to `elbow` with both bones at their lengths.
Eigen::Vector3d elbow_between(const Eigen::Vector3d& shoulder, const Eigen::Vector3d& wrist,
                              const Eigen::Vector3d& elbow, double upper, double lower) {
  const Eigen::Vector3d span = wrist - shoulder;
  const double distance = span.norm();
  const Eigen::Vector3d along = span / distance;
  const double foot = (distance * distance + upper * upper - lower * lower) / (2.0 * distance);
  const double radius = std::sqrt(std::max(upper * upper - foot * foot, 0.0));
  Eigen::Vector3d side = elbow - shoulder;
  side -= along.dot(side) * along;
  if (side.norm() < 1e-9) side = along.unitOrthogonal();
  return shoulder + foot * along + radius * side.normalized();
}

void keep_lengths(const Arm& arm, const HumanMotion& source, HumanMotion& adapted, int t) {
  const auto was = [&](int joint) { return Eigen::Vector3d(source.joints.at(t, joint)); };
  const auto is = [&](int joint) { return adapted.joints.at(t, joint); };
  const Eigen::Vector3d collar_bone = was(arm.shoulder) - was(arm.collar);
  const double upper = (was(arm.elbow) - was(arm.shoulder)).norm();
  const double lower = (was(arm.wrist) - was(arm.elbow)).norm();
  const Eigen::Vector3d shoulder = at_distance(is(arm.collar), is(arm.shoulder), collar_bone.norm(), collar_bone);
  Eigen::Vector3d wrist = is(arm.wrist);
  const double distance = std::clamp((wrist - shoulder).norm(), std::abs(upper - lower), upper + lower);
  wrist = at_distance(shoulder, wrist, std::max(distance, 1e-6), was(arm.wrist) - was(arm.shoulder));
  const Eigen::Vector3d elbow = elbow_between(shoulder, wrist, is(arm.elbow), upper, lower);
  is(arm.hand) = wrist + was(arm.hand) - was(arm.wrist);
  is(arm.shoulder) = shoulder;
  is(arm.elbow) = elbow;
  is(arm.wrist) = wrist;
}

}  // namespace

int human_offset_of(int smpl) {
  if (smpl >= kLeftShoulder && smpl <= kRightWrist) return smpl - kLeftShoulder;
  if (smpl == kLeftHand || smpl == kRightHand) return smpl - kLeftHand + 4;
  return -1;
}

Eigen::MatrixXd arm_bones(const HumanMotion& person) {
  Eigen::MatrixXd bones(3 * kArmBones, person.frames());
  for (int t = 0; t < person.frames(); ++t) {
    for (int k = 0; k < kArmBones; ++k)
      bones.block<3, 1>(3 * k, t) =
          person.joints.at(t, kLeftShoulder + k) - person.joints.at(t, kSmplParents[kLeftShoulder + k]);
  }
  return bones;
}

void keep_arm_lengths(const HumanMotion& source, HumanMotion& adapted) {
  for (int t = 0; t < source.frames(); ++t) {
    for (const Arm& arm : kArms) keep_lengths(arm, source, adapted, t);
  }
}

namespace {

constexpr double kObjectGuard = 1e-12;  // kDistanceGuard of retarget/pair_problem.h

}  // namespace

ObjectKeypoints make_object_keypoints(const CarriedObject& object, const PointTracks& source,
                                      const PointTracks& partner) {
  ObjectKeypoints out;
  if (object.empty()) return out;
  out.points = keypoint_tracks(object);
  const int keys = source.points(), count = out.count();
  out.distances.resize(2L * keys * count, source.frames());
  for (int t = 0; t < source.frames(); ++t) {
    Eigen::Index row = 0;
    for (const PointTracks* person : {&source, &partner})
      for (int i = 0; i < keys; ++i)
        for (int o = 0; o < count; ++o) out.distances(row++, t) = (person->at(t, i) - out.points.at(t, o)).norm();
  }
  return out;
}

double object_term(const ObjectKeypoints& object, const PairChain& chain, const ObjectFactors& factors,
                   double per_change, int t, const Eigen::Matrix3Xd& keys, Eigen::Matrix3Xd& key_force) {
  const int count = object.count();
  double sum = 0.0;
  for (int i = 0; i < 2 * chain.keys(); ++i) {
    const bool robot = i < chain.keys();
    const double factor = (robot ? factors.robot : factors.human) * chain.key_object[robot ? i : i - chain.keys()];
    if (factor == 0.0) continue;
    for (int o = 0; o < count; ++o) {
      const Eigen::Vector3d d = keys.col(i) - object.points.at(t, o);
      const double distance = std::sqrt(d.squaredNorm() + kObjectGuard);
      const double error = distance - object.distances(static_cast<Eigen::Index>(i) * count + o, t);
      sum += 2.0 * factor * error * error;
      key_force.col(i) += 4.0 * per_change * factor * error / distance * d;
    }
  }
  return sum;
}

}  // namespace duet
