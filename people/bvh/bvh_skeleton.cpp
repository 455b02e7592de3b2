#include "duet/people/bvh/bvh_skeleton.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/motion/layouts/joint_recipes.h"
#include "duet/people/bvh/bvh.h"

namespace duet {
namespace {

enum class BvhNaming { kCommon, kCmu, kXsens, kSoma };

// A hand that a skeleton lacks lies beyond the wrist by this part of the
// forearm: 0.08 m of SMPL's mean 0.25 m.
constexpr double kHandOfForearm = 0.32;
constexpr double kApart = 1e-3;  // of a lower leg: nearer joints lie in one place

class JointFinder {
 public:
  explicit JointFinder(const Bvh& bvh) : bvh_(bvh), names_(without_prefix(names_of(bvh.joints))) {}

  [[nodiscard]] int find(const std::string& name) const {
    for (std::size_t j = 0; j < names_.size(); ++j)
      if (names_[j] == name) return static_cast<int>(j);
    return -1;
  }
  // The first of `alternatives` that the file has; -1 where it has none.
  [[nodiscard]] int first(const std::vector<std::string>& alternatives) const {
    for (const std::string& name : alternatives)
      if (const int found = find(name); found >= 0) return found;
    return -1;
  }
  // The same; throws where the file has none.
  [[nodiscard]] int get(SmplJoint joint, const std::vector<std::string>& alternatives) const {
    if (const int found = first(alternatives); found >= 0) return found;
    const std::string nearest = closest_name(alternatives.front(), names_);
    throw InputError(
        fmt::format("'{}': no joint '{}' (for {}); {}", bvh_.name, fmt::join(alternatives, "' or '"), kSmplNames[joint],
                    nearest.empty() ? excerpt(fmt::format("joints found: {}", fmt::join(names_, ", ")), kShownSentence)
                                    : fmt::format("nearest found: '{}'", excerpt(nearest))));
  }

 private:
  const Bvh& bvh_;
  std::vector<std::string> names_;
};

BvhPoint at(int joint) { return {.from = joint, .toward = joint, .part = 0.0, .rotation = joint}; }
BvhPoint midway(int from, int toward, int rotation) {
  return {.from = from, .toward = toward, .part = 0.5, .rotation = rotation};
}

// Hands and feet of a skeleton: what the file has at their ends, where that
// lies apart, else what is made.
class Extremities {
 public:
  Extremities(const Bvh& bvh, BvhSkeleton& skeleton) : skeleton_(skeleton) {
    for (const Pose& X : global_poses(bvh, local_poses(bvh, 0))) places_.push_back(X.p);
  }

  // Whether the two lie apart in the first frame.
  [[nodiscard]] bool apart(int joint, int other) const {
    const Eigen::Vector3d shin = places_[skeleton_.points[kLeftAnkle].from] - places_[skeleton_.points[kLeftKnee].from];
    return (places_[joint] - places_[other]).norm() > kApart * shin.norm();
  }

  // The first of the joints (-1: none) that does not lie at the wrist.
  void put_hand(int side, std::initializer_list<int> joints) {
    const int elbow = skeleton_.points[side == 0 ? kLeftElbow : kRightElbow].from;
    const int wrist = skeleton_.points[side == 0 ? kLeftWrist : kRightWrist].from;
    BvhPoint& hand = skeleton_.points[side == 0 ? kLeftHand : kRightHand];
    for (const int joint : joints)
      if (joint >= 0 && apart(joint, wrist)) return void(hand = at(joint));
    hand = {.from = elbow, .toward = wrist, .part = 1.0 + kHandOfForearm, .rotation = wrist};
    note("hand", side, "made beyond the wrist along the forearm");
  }

  void put_toe(int side, std::initializer_list<int> joints) {
    const int ankle = skeleton_.points[side == 0 ? kLeftAnkle : kRightAnkle].from;
    BvhPoint& toe = skeleton_.points[side == 0 ? kLeftToe : kRightToe];
    for (const int joint : joints)
      if (joint >= 0 && apart(joint, ankle)) return void(toe = at(joint));
    toe = at(ankle);
    skeleton_.lacks_toe[side] = true;
    note("toe", side, "made ahead of the ankle");
  }

 private:
  void note(const char* part, int side, const char* how) {
    skeleton_.notes.push_back(
        fmt::format("the {} {} is {}: the file has none apart from it", side == 0 ? "left" : "right", part, how));
  }

  BvhSkeleton& skeleton_;
  std::vector<Eigen::Vector3d> places_;
};

using Names = std::vector<std::string>;

// The names that one way of naming gives the joints of a limb, without the side; the first that a file has counts.
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

void find_limbs(const Bvh& bvh, const JointFinder& finder, BvhNaming naming, BvhSkeleton& skeleton) {
  const LimbNames names = limb_names(naming);
  const auto sided = [](bool left, const Names& parts) {
    Names full_names;
    for (const std::string& name : parts) full_names.push_back((left ? "Left" : "Right") + name);
    return full_names;
  };
  for (const bool left : {true, false}) {
    const auto set = [&](SmplJoint left_joint, const Names& parts) {
      const auto joint = static_cast<SmplJoint>(left ? left_joint : kSmplMirror[left_joint]);
      skeleton.points[joint] = at(finder.get(joint, sided(left, parts)));
    };
    set(kLeftHip, names.hip);
    set(kLeftKnee, names.knee);
    set(kLeftAnkle, names.ankle);
    set(kLeftCollar, names.collar);
    set(kLeftShoulder, names.shoulder);
    set(kLeftElbow, names.elbow);
    set(kLeftWrist, names.wrist);
  }
  Extremities ends(bvh, skeleton);
  for (const int side : {0, 1}) {
    ends.put_hand(side, {finder.first(sided(side == 0, names.hand))});
    ends.put_toe(side, {finder.first(sided(side == 0, names.toe))});
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

BvhSkeleton by_naming(const Bvh& bvh) {
  constexpr std::array<const char*, 4> kNamings = {"common", "CMU", "Xsens", "SOMA"};
  const JointFinder finder(bvh);
  const BvhNaming naming = naming_of(finder);
  BvhSkeleton skeleton{.naming = kNamings[static_cast<std::size_t>(naming)], .points = {}};
  skeleton.points[kPelvis] = at(finder.get(kPelvis, {"Hips"}));
  find_limbs(bvh, finder, naming, skeleton);
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
  return skeleton;
}

// The joints by the parts of the body that they are; what is missing is made as
// for positions (joint_recipes.h).
class PartFinder {
 public:
  PartFinder(const Bvh& bvh, const Names& names) : bvh_(bvh), columns_(body_columns(bvh.name, names)) {
    require_parts(columns_, bvh.name);
  }

  BvhSkeleton find() {
    for (const int side : {0, 1}) put_limbs(side);
    Extremities ends(bvh_, skeleton_);
    for (const int side : {0, 1}) put_ends(side, ends);
    put_trunk(ends);
    for (const int side : {0, 1}) {
      const int collar = columns_.side[side][kCollarPart], shoulder = point(side, kLeftShoulder).from;
      point(side, kLeftCollar) = collar >= 0 ? at(collar) : between(skeleton_.points[kNeck].from, shoulder, kCollarOut);
    }
    return std::move(skeleton_);
  }

 private:
  BvhPoint& point(int side, SmplJoint left) { return skeleton_.points[side == 0 ? left : kSmplMirror[left]]; }
  static BvhPoint between(int from, int toward, double part) {
    return {.from = from, .toward = toward, .part = part, .rotation = from};
  }

  void put_limbs(int side) {
    const auto& part = columns_.side[side];
    for (const auto& [joint, column] : {std::pair{kLeftHip, kHipPart},
                                        {kLeftKnee, kKneePart},
                                        {kLeftAnkle, kAnklePart},
                                        {kLeftShoulder, kShoulderPart},
                                        {kLeftElbow, kElbowPart}})
      point(side, joint) = at(part[column]);
    // A joint that is called hand and follows the elbow lies at the wrist.
    point(side, kLeftWrist) = at(part[kWristPart] >= 0 ? part[kWristPart] : part[kHandPart]);
  }

  void put_ends(int side, Extremities& ends) {
    const auto& part = columns_.side[side];
    ends.put_hand(side, {part[kHandPart], end_of(point(side, kLeftWrist).from)});
    ends.put_toe(side, {part[kToePart], end_of(point(side, kLeftAnkle).from)});
  }

  // Its End Site; -1 where it has none.
  [[nodiscard]] int end_of(int joint) const {
    for (std::size_t j = 0; j < bvh_.joints.size(); ++j)
      if (bvh_.joints[j].parent == joint && bvh_.joints[j].name == bvh_.joints[joint].name + "/end")
        return static_cast<int>(j);
    return -1;
  }

  void put_trunk(const Extremities& ends) {
    auto& points = skeleton_.points;
    points[kPelvis] = at(columns_.pelvis >= 0 ? columns_.pelvis : bvh_.joints[points[kLeftHip].from].parent);
    points[kNeck] = columns_.neck >= 0 ? at(columns_.neck)
                                       : midway(points[kLeftShoulder].from, points[kRightShoulder].from,
                                                bvh_.joints[points[kLeftShoulder].from].parent);
    const int pelvis = points[kPelvis].from;
    std::vector<int> trunk;
    for (const int joint : columns_.trunk)
      if (ends.apart(joint, trunk.empty() ? pelvis : trunk.back())) trunk.push_back(joint);
    while (!trunk.empty() && columns_.neck >= 0 && !ends.apart(trunk.back(), columns_.neck)) trunk.pop_back();
    const bool at_neck = columns_.head >= 0 && columns_.neck >= 0 && !ends.apart(columns_.head, columns_.neck);
    points[kHead] = at(columns_.head >= 0 && !(at_neck && columns_.head_top >= 0) ? columns_.head
                       : columns_.head_top >= 0                                   ? columns_.head_top
                                                                                  : columns_.nose);
    put_spine(pelvis, trunk);
  }

  void put_spine(int pelvis, const std::vector<int>& trunk) {
    auto& points = skeleton_.points;
    const int neck = points[kNeck].from;
    if (trunk.empty()) {
      points[kSpine1] = between(pelvis, neck, kSpineAt[0]);
      points[kSpine2] = between(pelvis, neck, kSpineAt[1]);
      points[kSpine3] = between(pelvis, neck, kSpineAt[2]);
    } else if (trunk.size() == 1) {
      points[kSpine1] = between(pelvis, trunk[0], kSpineAt[0] / kSpineAt[1]);
      points[kSpine2] = at(trunk[0]);
      points[kSpine3] = between(trunk[0], neck, (kSpineAt[2] - kSpineAt[1]) / (1.0 - kSpineAt[1]));
    } else {
      points[kSpine1] = at(trunk.front());
      points[kSpine2] = trunk.size() == 2 ? between(trunk[0], trunk[1], 0.5) : at(trunk[(trunk.size() - 1) / 2]);
      points[kSpine3] = at(trunk.back());
    }
  }

  const Bvh& bvh_;
  BodyColumns columns_;
  BvhSkeleton skeleton_{.naming = "by parts of the body", .points = {}};
};

BvhSkeleton by_user_names(const Bvh& bvh, const std::string& file) {
  const std::optional<JointNameMap> map = parse_joint_name_map(read_plain_text(file), file);
  if (!map) throw InputError(fmt::format("'{}': expected lines 'left_hip: NAME IN THE BVH FILE', found none", file));
  BvhSkeleton skeleton = PartFinder(bvh, mapped(*map, names_of(bvh.joints), bvh.name)).find();
  skeleton.naming = "as told";
  return skeleton;
}

// The sentence of the known namings is the one that helps where no way of
// naming fits.
BvhSkeleton by_known_names(const Bvh& bvh) {
  try {
    return by_naming(bvh);
  } catch (const InputError& error) {
    try {
      return PartFinder(bvh, without_prefix(names_of(bvh.joints))).find();
    } catch (const InputError&) {
      throw InputError(fmt::format("{}; --skeleton FILE says which joint is which", error.what()));
    }
  }
}

}  // namespace

BvhSkeleton find_smpl_joints(const Bvh& bvh, const std::string& names) {
  BvhSkeleton skeleton = names.empty() ? by_known_names(bvh) : by_user_names(bvh, names);
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

namespace {

constexpr int kFewestJoints = 12;  // of a person: limbs and a head

class BranchFinder {
 public:
  explicit BranchFinder(const Bvh& bvh) : bvh_(bvh), sizes_(bvh.joints.size(), 1) {
    for (std::size_t j = bvh.joints.size(); j-- > 0;)
      if (bvh.joints[j].parent >= 0) sizes_[bvh.joints[j].parent] += sizes_[j];
  }

  // Branches below a joint (-1: the roots) that may be people.
  [[nodiscard]] std::vector<int> branches(int parent) const {
    std::vector<int> found;
    for (std::size_t j = 0; j < sizes_.size(); ++j)
      if (bvh_.joints[j].parent == parent && sizes_[j] >= kFewestJoints) found.push_back(static_cast<int>(j));
    return found;
  }

  // The branch with the joints above it.
  [[nodiscard]] Bvh cut(int top) const {
    std::vector<bool> kept(sizes_.size(), false);
    for (int j = top; j >= 0; j = bvh_.joints[j].parent) kept[j] = true;
    for (std::size_t j = top + 1; j < sizes_.size(); ++j)
      if (bvh_.joints[j].parent >= top) kept[j] = kept[j] || kept[bvh_.joints[j].parent];
    return with(kept);
  }

 private:
  [[nodiscard]] Bvh with(const std::vector<bool>& kept) const {
    Bvh person{.name = bvh_.name, .joints = {}, .frame_time = bvh_.frame_time, .frames = bvh_.frames, .values = {}};
    person.notes = bvh_.notes;
    std::vector<int> place(kept.size(), -1);
    std::vector<bool> columns;
    for (std::size_t j = 0; j < kept.size(); ++j) {
      columns.insert(columns.end(), bvh_.joints[j].channels.size(), kept[j]);
      if (!kept[j]) continue;
      place[j] = static_cast<int>(person.joints.size());
      person.joints.push_back(bvh_.joints[j]);
      int& parent = person.joints.back().parent;
      if (parent >= 0) parent = place[parent];
    }
    for (std::size_t i = 0; i < bvh_.values.size(); ++i)
      if (columns[i % columns.size()]) person.values.push_back(bvh_.values[i]);
    return person;
  }

  const Bvh& bvh_;
  std::vector<int> sizes_;  // of the branch of each joint, itself included
};

bool is_person(const Bvh& bvh, const std::string& names) {
  try {
    (void)find_smpl_joints(bvh, names);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace

std::array<Bvh, 2> two_people_in(const Bvh& bvh, const std::string& names) {
  const BranchFinder finder(bvh);
  std::vector<int> level = finder.branches(-1);
  while (!level.empty()) {
    std::vector<Bvh> people;
    if (level.size() > 1)
      for (const int top : level)
        if (Bvh branch = finder.cut(top); is_person(branch, names)) people.push_back(std::move(branch));
    if (people.size() == 2) return {std::move(people[0]), std::move(people[1])};
    if (level.size() > 1) break;
    level = finder.branches(level.front());
  }
  throw InputError(
      fmt::format("'{}': expected two people in one BVH file, or a pair of files, one a "
                  "person; found {}",
                  bvh.name, is_person(bvh, names) ? "one person" : "nobody whose joints are known"));
}

}  // namespace duet
