#include "duet/motion/bvh_skeleton.h"

#include <fmt/format.h>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/motion/bvh_kinematics.h"

namespace duet {
namespace {

enum class BvhNaming { kCommon, kCmu, kXsens, kSoma };

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

using Names = std::vector<std::string>;

// What a way of naming calls the joints of a limb, without the side; the first that a file has.
struct LimbNames {
  Names hip, knee, ankle, toe, collar, shoulder, elbow, wrist, hand;
};

LimbNames limb_names(BvhNaming naming) {
  LimbNames names{.hip = {"UpLeg"},
                  .knee = {"Leg"},
                  .ankle = {"Foot"},
                  .toe = {"ToeBase", "Toe", "Foot/end"},
                  .collar = {"Shoulder"},
                  .shoulder = {"Arm"},
                  .elbow = {"ForeArm"},
                  .wrist = {"Hand"},
                  .hand = {"HandMiddle1", "HandIndex1", "Hand/end"}};
  if (naming == BvhNaming::kCmu) names.hand = {"HandIndex1/end"};
  if (naming == BvhNaming::kSoma) {
    names.hip = {"Leg"};
    names.knee = {"Shin"};
  }
  if (naming == BvhNaming::kXsens)
    names = {.hip = {"Hip"},
             .knee = {"Knee"},
             .ankle = {"Ankle"},
             .toe = {"Toe", "Ankle/end"},
             .collar = {"Collar"},
             .shoulder = {"Shoulder"},
             .elbow = {"Elbow"},
             .wrist = {"Wrist"},
             .hand = {"Wrist/end"}};
  return names;
}

void find_limbs(const JointFinder& finder, BvhNaming naming, BvhSkeleton& skeleton) {
  const LimbNames names = limb_names(naming);
  for (const bool left : {true, false}) {
    const std::string side = left ? "Left" : "Right";
    const auto set = [&](SmplJoint left_joint, const Names& parts) {
      const auto joint = static_cast<SmplJoint>(left ? left_joint : kSmplMirror[left_joint]);
      Names full_names;
      full_names.reserve(parts.size());
      for (const std::string& name : parts) full_names.push_back(side + name);
      skeleton.points[joint] = at(finder.get(joint, full_names));
    };
    set(kLeftHip, names.hip);
    set(kLeftKnee, names.knee);
    set(kLeftAnkle, names.ankle);
    set(kLeftToe, names.toe);
    set(kLeftCollar, names.collar);
    set(kLeftShoulder, names.shoulder);
    set(kLeftElbow, names.elbow);
    set(kLeftWrist, names.wrist);
    set(kLeftHand, names.hand);
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

void find_soma_trunk(const JointFinder& finder, BvhSkeleton& skeleton) {
  skeleton.points[kSpine1] = at(finder.get(kSpine1, {"Spine1"}));
  skeleton.points[kSpine2] = at(finder.get(kSpine2, {"Spine2"}));
  skeleton.points[kSpine3] = at(finder.get(kSpine3, {"Chest"}));
  skeleton.points[kNeck] = at(finder.get(kNeck, {"Neck1", "Neck"}));
  skeleton.points[kHead] = at(finder.get(kHead, {"Head"}));
}

// Xsens names the vertebrae Chest, Chest2, Chest3, Chest4; files of other makers that take its names have fewer.
void find_xsens_trunk(const JointFinder& finder, BvhSkeleton& skeleton) {
  const int chest = finder.get(kSpine1, {"Chest"});
  const int top = finder.get(kSpine3, {"Chest4", "Chest3", "Chest2"});
  const int middle = finder.find("Chest4") >= 0   ? finder.find("Chest3")
                     : finder.find("Chest3") >= 0 ? finder.find("Chest2")
                                                  : -1;
  skeleton.points[kSpine1] = at(chest);
  skeleton.points[kSpine2] = middle >= 0 ? at(middle) : midway(chest, top, chest);
  skeleton.points[kSpine3] = at(top);
  skeleton.points[kNeck] = at(finder.get(kNeck, {"Neck"}));
  skeleton.points[kHead] = at(finder.get(kHead, {"Head"}));
}

BvhNaming naming_of(const JointFinder& finder) {
  if (finder.find("LowerBack") >= 0) return BvhNaming::kCmu;
  if (finder.find("LeftShin") >= 0) return BvhNaming::kSoma;
  if (finder.find("LeftCollar") >= 0 && finder.find("LeftElbow") >= 0) return BvhNaming::kXsens;
  return BvhNaming::kCommon;
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
  constexpr std::array<const char*, 4> kNamings = {"common", "CMU", "Xsens", "SOMA"};
  const JointFinder finder(bvh);
  const BvhNaming naming = naming_of(finder);
  BvhSkeleton skeleton{.naming = kNamings[static_cast<std::size_t>(naming)], .points = {}};
  skeleton.points[kPelvis] = at(finder.get(kPelvis, {"Hips"}));
  find_limbs(finder, naming, skeleton);
  switch (naming) {
    case BvhNaming::kCommon:
      find_common_trunk(finder, skeleton);
      break;
    case BvhNaming::kCmu:
      find_cmu_trunk(finder, skeleton);
      break;
    case BvhNaming::kXsens:
      find_xsens_trunk(finder, skeleton);
      break;
    case BvhNaming::kSoma:
      find_soma_trunk(finder, skeleton);
      break;
  }
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
