#include "motion/bvh_skeleton.h"

#include <fmt/format.h>

#include "core/names.h"
#include "core/require.h"
#include "core/text.h"
#include "motion/bvh_kinematics.h"

namespace duet {
namespace {

// "mixamorig:LeftArm" is LeftArm.
std::string plain_name(const std::string& name) {
  const std::size_t colon = name.rfind(':');
  return colon == std::string::npos ? name : name.substr(colon + 1);
}

class JointFinder {
 public:
  explicit JointFinder(const Bvh& bvh) : bvh_(bvh) {
    for (const BvhJoint& joint : bvh.joints) names_.push_back(plain_name(joint.name));
  }

  [[nodiscard]] int find(const std::string& name) const {
    for (std::size_t j = 0; j < names_.size(); ++j)
      if (names_[j] == name) return static_cast<int>(j);
    return -1;
  }
  // The first of `alternatives` that the file has.
  [[nodiscard]] int get(SmplJoint joint, const std::vector<std::string>& alternatives) const {
    for (const std::string& name : alternatives)
      if (const int found = find(name); found >= 0) return found;
    const std::string nearest = closest_name(alternatives.front(), names_);
    throw InputError(
        fmt::format("'{}': no joint '{}' (for {}); {}", bvh_.name, fmt::join(alternatives, "' or '"), kSmplNames[joint],
                    nearest.empty() ? shown(fmt::format("joints found: {}", fmt::join(names_, ", ")), kShownSentence)
                                    : fmt::format("nearest found: '{}'", shown(nearest))));
  }

 private:
  const Bvh& bvh_;
  std::vector<std::string> names_;
};

BvhPoint at(int joint) { return {.from = joint, .toward = joint, .part = 0.0, .rotation = joint}; }
BvhPoint midway(int from, int toward, int rotation) {
  return {.from = from, .toward = toward, .part = 0.5, .rotation = rotation};
}

void find_limbs(const JointFinder& finder, bool cmu, BvhSkeleton& skeleton) {
  for (const bool left : {true, false}) {
    const std::string side = left ? "Left" : "Right";
    const auto set = [&](SmplJoint left_joint, const std::vector<std::string>& names) {
      const auto joint = static_cast<SmplJoint>(left ? left_joint : kSmplMirror[left_joint]);
      std::vector<std::string> full_names;
      full_names.reserve(names.size());
      for (const std::string& name : names) full_names.push_back(side + name);
      skeleton.points[joint] = at(finder.get(joint, full_names));
    };
    using Names = std::vector<std::string>;
    set(kLeftHip, {"UpLeg"});
    set(kLeftKnee, {"Leg"});
    set(kLeftAnkle, {"Foot"});
    set(kLeftToe, {"ToeBase", "Toe", "Foot/end"});
    set(kLeftCollar, {"Shoulder"});
    set(kLeftShoulder, {"Arm"});
    set(kLeftElbow, {"ForeArm"});
    set(kLeftWrist, {"Hand"});
    set(kLeftHand, cmu ? Names{"HandIndex1/end"} : Names{"HandMiddle1", "HandIndex1", "Hand/end"});
  }
}

void find_cmu_trunk(const JointFinder& finder, BvhSkeleton& skeleton) {
  const int spine = finder.get(kSpine2, {"Spine"});
  skeleton.points[kSpine1] = midway(skeleton.points[kPelvis].from, spine, finder.get(kSpine1, {"LowerBack"}));
  skeleton.points[kSpine2] = at(spine);
  skeleton.points[kSpine3] = at(finder.get(kSpine3, {"Spine1"}));
  skeleton.points[kNeck] = at(finder.get(kNeck, {"Neck1"}));
  skeleton.points[kHead] = at(finder.get(kHead, {"Head/end"}));
}

void find_common_trunk(const JointFinder& finder, BvhSkeleton& skeleton) {
  const int spine = finder.get(kSpine1, {"Spine"});
  const int spine1 = finder.get(kSpine2, {"Spine1"});
  const int spine2 = finder.find("Spine2");
  skeleton.points[kSpine1] = at(spine);
  skeleton.points[kSpine2] = spine2 >= 0 ? at(spine1) : midway(spine, spine1, spine);
  skeleton.points[kSpine3] = at(spine2 >= 0 ? spine2 : spine1);
  skeleton.points[kNeck] = at(finder.get(kNeck, {"Neck"}));
  skeleton.points[kHead] = at(finder.get(kHead, {"Head"}));
}

// Some skeletons (CMU's) begin the collar bone at the spine; a joint half way along it keeps the bone to the spine.
void move_collars(const Bvh& bvh, BvhSkeleton& skeleton) {
  const SmplPositions rest = smpl_positions(skeleton, global_poses(bvh, zero_local_poses(bvh)));
  const double shortest = 1e-3 * stature(rest);
  for (const auto& [collar, shoulder] : {std::pair{kLeftCollar, kLeftShoulder}, {kRightCollar, kRightShoulder}}) {
    const int joint = skeleton.points[collar].from;
    if ((rest.col(collar) - rest.col(kSpine3)).norm() < shortest)
      skeleton.points[collar] = midway(joint, skeleton.points[shoulder].from, joint);
  }
}

}  // namespace

BvhSkeleton find_smpl_joints(const Bvh& bvh) {
  const JointFinder finder(bvh);
  const bool cmu = finder.find("LowerBack") >= 0;
  BvhSkeleton skeleton{.naming = cmu ? "CMU" : "common", .points = {}};
  skeleton.points[kPelvis] = at(finder.get(kPelvis, {"Hips"}));
  find_limbs(finder, cmu, skeleton);
  cmu ? find_cmu_trunk(finder, skeleton) : find_common_trunk(finder, skeleton);
  move_collars(bvh, skeleton);
  return skeleton;
}

SmplPositions smpl_positions(const BvhSkeleton& skeleton, const std::vector<Pose>& global) {
  SmplPositions positions;
  for (int j = 0; j < kSmplJoints; ++j) {
    const BvhPoint& point = skeleton.points[j];
    const Eigen::Vector3d& p = global[point.from].p;
    positions.col(j) = p + point.part * (global[point.toward].p - p);
  }
  return positions;
}

double stature(const SmplPositions& positions) {
  const auto bones_up = [&](int joint) {
    double length = 0.0;
    for (; kSmplParents[joint] >= 0; joint = kSmplParents[joint])
      length += (positions.col(joint) - positions.col(kSmplParents[joint])).norm();
    return length;
  };
  return bones_up(kHead) + 0.5 * (bones_up(kLeftAnkle) + bones_up(kRightAnkle));
}

}  // namespace duet
