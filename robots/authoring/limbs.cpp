#include "duet/robots/authoring/limbs.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "duet/robots/roles.h"

namespace duet {
namespace {

constexpr double kCentral = 5e-3;   // most that a central hinge is from the middle [m]
constexpr double kSameLimb = 0.05;  // most that a hinge is from the mirror image of its counterpart [m]
constexpr double kAcross = 0.9;     // least cosine of a hinge that turns about an axis
constexpr double kTilted = 0.6;     // and of one between two
constexpr double kUpperArm = 0.25;  // least share of the arm's length above the elbow
constexpr double kThigh = 0.15;     // least share of the leg's length above the knee
constexpr double kStraight = 0.3;   // most angle between thigh and shin of a straight leg [rad]
constexpr double kBend = 0.4;       // of the knee of a standing pose [rad]
constexpr double kHanging = 0.6;    // least cosine between the vertical and an arm that hangs

bool is_hinge(const UrdfJoint& joint) {
  return (joint.type == UrdfJointType::kRevolute || joint.type == UrdfJointType::kContinuous) && joint.mimics.empty();
}

bool is_rigid_joint(const UrdfJoint& joint) {
  return joint.type == UrdfJointType::kFixed || joint.type == UrdfJointType::kFloating;
}

class LimbFinder {
 public:
  explicit LimbFinder(const UrdfModel& urdf) : urdf_(urdf), joint_of_(urdf.links.size(), -1) {
    limbs_.base = base();
    X_ = poses_in_base(urdf, limbs_.base, std::vector<double>(urdf.joints.size(), 0.0));
    for (std::size_t j = 0; j < urdf.joints.size(); ++j) joint_of_[urdf.joints[j].child] = static_cast<int>(j);
    parent_.assign(urdf.joints.size(), -1);
    children_.resize(urdf.joints.size());
    for (int j = 0; j < count(); ++j) {
      if (!is_hinge(urdf.joints[j])) continue;
      parent_[j] = hinge_above(urdf.joints[j].parent);
      if (parent_[j] >= 0) children_[parent_[j]].push_back(j);
    }
    middle_ = middle();
  }

  Limbs find() {
    std::vector<std::array<std::vector<int>, 2>> pairs = limb_pairs();
    const auto lowest = [&](const std::array<std::vector<int>, 2>& pair) { return place(pair[0].back()).z(); };
    if (!pairs.empty()) {
      const auto legs = std::ranges::min_element(pairs, {}, lowest);
      limbs_.legs = *legs;
      pairs.erase(legs);
    }
    if (!pairs.empty())
      limbs_.arms = *std::ranges::max_element(pairs, {}, [](const auto& pair) { return pair[0].size(); });
    find_middle_joints();
    for (int side = 0; side < 2; ++side) {
      find_knee(side);
      find_elbow(side);
    }
    return std::move(limbs_);
  }

 private:
  [[nodiscard]] int count() const { return static_cast<int>(urdf_.joints.size()); }
  [[nodiscard]] Eigen::Vector3d place(int joint) const { return X_[urdf_.joints[joint].child].p; }
  [[nodiscard]] Eigen::Vector3d axis(int joint) const {
    return X_[urdf_.joints[joint].child].R * urdf_.joints[joint].axis;
  }

  [[nodiscard]] int base() const {
    const bool world =
        !urdf_.joints.empty() && urdf_.joints[0].type == UrdfJointType::kFloating && urdf_.links[0].mass == 0.0;
    return world ? 1 : 0;
  }

  [[nodiscard]] int hinge_above(int link) const {
    for (int joint = joint_of_[link]; joint >= 0; joint = joint_of_[urdf_.joints[joint].parent])
      if (is_hinge(urdf_.joints[joint])) return joint;
    return -1;
  }

  // For a robot whose sides mirror one another.
  [[nodiscard]] double middle() const {
    double sum = 0.0;
    int hinges = 0;
    for (int j = 0; j < count(); ++j) {
      if (!is_hinge(urdf_.joints[j])) continue;
      sum += place(j).y();
      ++hinges;
    }
    return hinges == 0 ? 0.0 : sum / hinges;
  }
  [[nodiscard]] double sideways(int joint) const { return place(joint).y() - middle_; }
  [[nodiscard]] bool is_central(int joint) const { return std::abs(sideways(joint)) <= kCentral; }

  // The hinges from where a limb begins to where it branches or ends.
  [[nodiscard]] std::vector<int> limb_from(int joint) const {
    std::vector<int> limb = {joint};
    while (children_[limb.back()].size() == 1) limb.push_back(children_[limb.back()][0]);
    return limb;
  }

  [[nodiscard]] std::vector<std::array<std::vector<int>, 2>> limb_pairs() const {
    std::array<std::vector<int>, 2> begins;
    for (int j = 0; j < count(); ++j) {
      if (!is_hinge(urdf_.joints[j]) || is_central(j)) continue;
      if (parent_[j] < 0 || is_central(parent_[j])) begins[sideways(j) > 0.0 ? 0 : 1].push_back(j);
    }
    std::vector<std::array<std::vector<int>, 2>> pairs;
    for (const int left : begins[0]) {
      const Eigen::Vector3d image(place(left).x(), 2.0 * middle_ - place(left).y(), place(left).z());
      const auto right = std::ranges::min_element(begins[1], {}, [&](int j) { return (place(j) - image).norm(); });
      if (right == begins[1].end() || (place(*right) - image).norm() > kSameLimb) continue;
      std::array<std::vector<int>, 2> pair = {limb_from(left), limb_from(*right)};
      const std::size_t both = std::min(pair[0].size(), pair[1].size());
      for (std::vector<int>& limb : pair) limb.resize(both);
      pairs.push_back(std::move(pair));
      begins[1].erase(right);
    }
    return pairs;
  }

  // Hinges between pelvis and trunk, whichever of the two is the base; what is left in the middle is the neck.
  void find_middle_joints() {
    const auto above = [&](const std::array<std::vector<int>, 2>& limb) {
      std::vector<int> joints;
      if (limb[0].empty()) return joints;
      for (int j = parent_[limb[0][0]]; j >= 0; j = parent_[j]) joints.push_back(j);
      return joints;
    };
    const std::vector<int> legs = above(limbs_.legs), arms = above(limbs_.arms);
    const auto link_below = [&](const std::vector<int>& joints) {
      return joints.empty() ? limbs_.base : urdf_.joints[joints[0]].child;
    };
    limbs_.pelvis = link_below(legs);
    limbs_.trunk = link_below(arms);
    const auto has = [](const std::vector<int>& joints, int j) { return std::ranges::find(joints, j) != joints.end(); };
    for (int j = 0; j < count(); ++j) {
      if (is_rigid_joint(urdf_.joints[j])) continue;
      bool limb = false;
      for (int side = 0; side < 2; ++side) limb = limb || has(limbs_.legs[side], j) || has(limbs_.arms[side], j);
      if (limb) continue;
      if (has(legs, j) != has(arms, j))
        limbs_.waist.push_back(j);
      else if (is_hinge(urdf_.joints[j]) && is_central(j) && in_the_middle(j))
        limbs_.neck.push_back(j);
      else
        limbs_.rest.push_back(j);
    }
  }
  [[nodiscard]] bool in_the_middle(int joint) const {
    for (int j = joint; j >= 0; j = parent_[j])
      if (!is_central(j)) return false;
    return true;
  }

  // The first hinge across the leg well below the first one that swings it, and the first one below that.
  void find_knee(int side) {
    const std::vector<int>& leg = limbs_.legs[side];
    if (leg.empty()) return;
    const double apart = kThigh * (place(leg.front()) - place(leg.back())).norm();
    int& hip = limbs_.hip_pitch[side];
    for (const int j : leg) {
      const double across = std::abs(axis(j).y());
      if (hip < 0 ? across >= kTilted
                  : limbs_.knee[side] < 0 && across >= kTilted && (place(j) - place(hip)).norm() < apart)
        hip = j;
      else if (hip >= 0 && across >= kAcross && limbs_.knee[side] < 0)
        limbs_.knee[side] = j;
      else if (limbs_.knee[side] >= 0 && across >= kAcross && limbs_.ankle[side] < 0)
        limbs_.ankle[side] = j;
    }
  }

  // The first hinge across the upper arm.
  void find_elbow(int side) {
    const std::vector<int>& arm = limbs_.arms[side];
    if (arm.empty()) return;
    double length = 0.0;
    for (std::size_t i = 1; i < arm.size(); ++i) length += (place(arm[i]) - place(arm[i - 1])).norm();
    for (const int j : arm) {
      const Eigen::Vector3d upper = place(j) - place(arm[0]);
      if (upper.norm() < kUpperArm * length || upper.norm() == 0.0) continue;
      if (std::abs(upper.normalized().dot(axis(j))) > kTilted) continue;
      limbs_.elbow[side] = j;
      return;
    }
  }

  const UrdfModel& urdf_;
  Limbs limbs_;
  std::vector<int> joint_of_;  // of each link, the joint that ends in it
  std::vector<Pose> X_;
  std::vector<int> parent_;  // of each hinge, the one above it
  std::vector<std::vector<int>> children_;
  double middle_ = 0.0;
};

double kept_within(const UrdfJoint& joint, double angle) {
  return joint.lower < joint.upper ? std::clamp(angle, joint.lower, joint.upper) : angle;
}

// Bends a straight leg at hip, knee and ankle so that the foot stays level, where the three turn across it.
void bend_leg(const UrdfModel& urdf, const Limbs& limbs, int side, std::vector<double>& angles) {
  const std::array<int, 3> joints = {limbs.hip_pitch[side], limbs.knee[side], limbs.ankle[side]};
  if (std::ranges::any_of(joints, [](int j) { return j < 0; })) return;
  const std::vector<Pose> X = poses_in_base(urdf, limbs.base, angles);
  const auto place = [&](int j) { return X[urdf.joints[j].child].p; };
  const Eigen::Vector3d thigh = place(joints[1]) - place(joints[0]), shin = place(joints[2]) - place(joints[1]);
  const Eigen::Vector2d a(thigh.x(), thigh.z()), b(shin.x(), shin.z());
  if (std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)) > kStraight) return;
  const std::array<double, 3> turns = {-0.5 * kBend, kBend, -0.5 * kBend};
  std::array<double, 3> bent{};
  for (int i = 0; i < 3; ++i) {
    const UrdfJoint& joint = urdf.joints[joints[i]];
    const double across = (X[joint.child].R * joint.axis).y();
    bent[i] = angles[joints[i]] + std::copysign(turns[i], across * turns[i]);
    if (std::abs(across) < kAcross || bent[i] != kept_within(joint, bent[i])) return;
  }
  for (int i = 0; i < 3; ++i) angles[joints[i]] = bent[i];
}

// Turns the hinge of the left shoulder that brings the hand lowest without bringing it into the body.
void lower_left_arm(const UrdfModel& urdf, const Limbs& limbs, std::vector<double>& angles) {
  const std::vector<int>& arm = limbs.arms[0];
  if (arm.size() < 2) return;
  const auto hand = [&](const std::vector<double>& at) {
    const std::vector<Pose> X = poses_in_base(urdf, limbs.base, at);
    return std::pair(X[urdf.joints[arm.back()].child].p, X[urdf.joints[arm.front()].child].p);
  };
  const auto [begin, shoulder] = hand(angles);
  const Eigen::Vector3d along = begin - shoulder;
  if (along.norm() < 1e-6 || -along.normalized().z() > kHanging) return;
  double lowest = begin.z();
  std::vector<double> best = angles;
  for (const int j : arm) {
    if (j == limbs.elbow[0]) break;
    for (int step = -15; step <= 15; ++step) {
      std::vector<double> tried = angles;
      tried[j] = kept_within(urdf.joints[j], 0.1 * step);
      const auto [at, from] = hand(tried);
      if (at.z() >= lowest - 1e-3 || at.y() < from.y()) continue;
      lowest = at.z();
      best = tried;
    }
  }
  angles = best;
}

// The right arm as the left one.
void mirror_arm(const UrdfModel& urdf, const Limbs& limbs, std::vector<double>& angles) {
  const std::vector<Pose> X = poses_in_base(urdf, limbs.base, std::vector<double>(urdf.joints.size(), 0.0));
  const auto axis = [&](int j) -> Eigen::Vector3d { return X[urdf.joints[j].child].R * urdf.joints[j].axis; };
  for (std::size_t i = 0; i < limbs.arms[0].size(); ++i) {
    const int left = limbs.arms[0][i], right = limbs.arms[1][i];
    if (angles[left] == kept_within(urdf.joints[left], 0.0)) continue;
    const double sign = mirrored_axis(axis(left)).dot(axis(right)) > 0.0 ? 1.0 : -1.0;
    angles[right] = kept_within(urdf.joints[right], sign * angles[left]);
  }
}

}  // namespace

Limbs find_limbs(const UrdfModel& urdf) { return LimbFinder(urdf).find(); }

std::vector<Pose> poses_in_base(const UrdfModel& urdf, int base, const std::vector<double>& angles) {
  std::vector<Pose> X(urdf.links.size());
  for (std::size_t j = 0; j < urdf.joints.size(); ++j) {
    const UrdfJoint& joint = urdf.joints[j];
    if (joint.child <= base) continue;
    Pose moved;
    if (joint.type == UrdfJointType::kPrismatic)
      moved.p = angles[j] * joint.axis;
    else if (!is_rigid_joint(joint))
      moved.R = Eigen::Quaterniond(Eigen::AngleAxisd(angles[j], joint.axis));
    X[joint.child] = X[joint.parent] * joint.X_PC * moved;
  }
  return X;
}

int carrier_of(const UrdfModel& urdf, int link, const std::vector<bool>& moves) {
  for (std::size_t j = urdf.joints.size(); j-- > 0;) {
    if (urdf.joints[j].child != link) continue;
    if (moves[j]) return link;
    link = urdf.joints[j].parent;
  }
  return link;
}

std::vector<double> standing_angles(const UrdfModel& urdf, const Limbs& limbs) {
  std::vector<double> angles(urdf.joints.size(), 0.0);
  for (std::size_t j = 0; j < urdf.joints.size(); ++j) angles[j] = kept_within(urdf.joints[j], 0.0);
  for (int side = 0; side < 2; ++side) bend_leg(urdf, limbs, side, angles);
  lower_left_arm(urdf, limbs, angles);
  mirror_arm(urdf, limbs, angles);
  return angles;
}

std::string turn_of(const UrdfModel& urdf, const Limbs& limbs, int joint) {
  const std::vector<Pose> X = poses_in_base(urdf, limbs.base, std::vector<double>(urdf.joints.size(), 0.0));
  const Eigen::Vector3d axis = (X[urdf.joints[joint].child].R * urdf.joints[joint].axis).cwiseAbs();
  const char* const names[] = {"roll", "pitch", "yaw"};
  std::string text;
  for (int i = 0; i < 3; ++i)
    if (axis[i] >= kTilted) text += fmt::format("{}{}", text.empty() ? "" : " and ", names[i]);
  return text.empty() ? "oblique" : text;
}

}  // namespace duet
