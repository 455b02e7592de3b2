#include "duet/retarget/pair_chain.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

bool is_hand(int smpl) { return smpl == kLeftHand || smpl == kRightHand; }

void check_pairs(const RobotModel& robot) {
  require(robot.pairs.size() == kRetargetPairs, "robot '{}': expected the 16 retarget pairs of A.1.1, found {}",
          robot.name, robot.pairs.size());
  require(robot.pairs.front().smpl == kPelvis,
          "robot '{}': expected the pelvis as the first retarget pair, found SMPL joint {}", robot.name,
          robot.pairs.front().smpl);
  for (int i = 0; i < kRetargetPairs; ++i) {
    const RetargetPair& pair = robot.pairs[i];
    const bool inside = pair.frame >= 0 && pair.frame < static_cast<int>(robot.frames.size()) && pair.smpl >= 0 &&
                        pair.smpl < kSmplJoints;
    require(inside, "robot '{}': retarget pair {} names frame {} and SMPL joint {}, which do not exist", robot.name, i,
            pair.frame, pair.smpl);
    for (int k = 0; k < i; ++k) {
      require(robot.pairs[k].smpl != pair.smpl, "robot '{}': retarget pairs {} and {} name the same SMPL joint",
              robot.name, k, i);
    }
  }
}

void check_links(const RobotModel& robot) {
  require(robot.links.size() == robot.joints.size() + 1,
          "robot '{}': expected one link more than joints, found {} links and {} joints", robot.name,
          robot.links.size(), robot.joints.size());
  for (std::size_t i = 1; i < robot.links.size(); ++i) {
    const int parent = robot.links[i].parent;
    require(parent >= 0 && parent < static_cast<int>(i), "robot '{}': link '{}' comes before its parent", robot.name,
            robot.links[i].name);
  }
}

// A rotation after which the hinge axis is a coordinate axis: the identity where it already is one.
Eigen::Matrix3d align_axis(const Eigen::Vector3d& axis, int& index) {
  for (index = 0; index < 3; ++index) {
    if (axis == Eigen::Vector3d(Eigen::Vector3d::Unit(index))) return Eigen::Matrix3d::Identity();
  }
  index = 2;
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), axis).toRotationMatrix();
}

// `turns[l]`: rotation of the chain's frame of link l in the model's.
std::vector<ChainJoint> make_joints(const RobotModel& robot, std::vector<Eigen::Matrix3d>& turns) {
  turns.assign(robot.links.size(), Eigen::Matrix3d::Identity());
  std::vector<ChainJoint> joints;
  for (std::size_t i = 1; i < robot.links.size(); ++i) {
    const RobotLink& link = robot.links[i];
    ChainJoint joint;
    joint.parent = link.parent;
    turns[i] = align_axis(link.axis, joint.axis);
    joint.offset = turns[link.parent].transpose() * link.X_PL.p;
    joint.rotation = turns[link.parent].transpose() * link.X_PL.R.toRotationMatrix() * turns[i];
    joint.turned = joint.rotation != Eigen::Matrix3d::Identity();
    joint.lower = robot.joints[i - 1].lower;
    joint.upper = robot.joints[i - 1].upper;
    require(joint.lower <= joint.upper, "robot '{}': joint '{}' has its lower limit above its upper", robot.name,
            robot.joints[i - 1].name);
    joints.push_back(joint);
  }
  return joints;
}

struct FrameAndJoint {
  int frame = 0;
  int smpl = 0;
};

// Keypoints that the user lists.
void add_listed_keypoints(const RobotModel& robot, const std::vector<ContactKeypoint>& list,
                          std::vector<FrameAndJoint>& chosen, PairChain& chain) {
  const std::vector<int> frames = robot_frames(robot, list);
  for (std::size_t i = 0; i < list.size(); ++i) {
    chosen.push_back({frames[i], list[i].smpl});
    chain.key_weight.push_back(list[i].weight);
  }
  chain.key_object = object_weights(list);
}

// A set of keypoints of the paper, each as heavy as the others.
std::vector<FrameAndJoint> choose_keypoints(const RobotModel& robot, ContactKeypoints choice) {
  std::vector<FrameAndJoint> chosen;
  for (const Keypoint& key : robot.keypoints) {
    if (choice != ContactKeypoints::kSeven || !is_hand(key.smpl)) chosen.push_back({key.frame, key.smpl});
  }
  if (choice == ContactKeypoints::kEleven) {
    for (const RetargetPair& pair : robot.pairs) {
      if (pair.smpl == kLeftHip || pair.smpl == kRightHip) chosen.push_back({pair.frame, pair.smpl});
    }
  }
  const int expected = choice == ContactKeypoints::kSeven ? 7 : choice == ContactKeypoints::kNine ? 9 : 11;
  require(static_cast<int>(chosen.size()) == expected,
          "robot '{}': expected {} interaction keypoints (head, shoulders, elbows, wrists, ...), found {}", robot.name,
          expected, chosen.size());
  for (const FrameAndJoint& key : chosen) {
    const bool inside =
        key.frame >= 0 && key.frame < static_cast<int>(robot.frames.size()) && key.smpl >= 0 && key.smpl < kSmplJoints;
    require(inside, "robot '{}': a keypoint names frame {} and SMPL joint {}, which do not exist", robot.name,
            key.frame, key.smpl);
  }
  return chosen;
}

}  // namespace

bool PairChain::weighted() const {
  return std::any_of(key_weight.begin(), key_weight.end(), [](double weight) { return weight != 1.0; });
}

PairChain make_chain(const RobotModel& robot, ContactKeypoints keypoints, const std::vector<ContactKeypoint>& list) {
  check_links(robot);
  check_pairs(robot);
  std::vector<Eigen::Matrix3d> turns;
  PairChain chain;
  chain.joints = make_joints(robot, turns);

  std::vector<int> point_of_frame(robot.frames.size(), -1);
  const auto point = [&](int frame) {
    if (point_of_frame[frame] >= 0) return point_of_frame[frame];
    const RobotFrame& f = robot.frames[frame];
    chain.points.push_back({f.link, turns.at(f.link).transpose() * f.X_LF.p});
    return point_of_frame[frame] = static_cast<int>(chain.points.size()) - 1;
  };
  for (const RetargetPair& pair : robot.pairs) chain.pair_points.push_back(point(pair.frame));
  std::vector<FrameAndJoint> chosen;
  if (list.empty()) {
    chosen = choose_keypoints(robot, keypoints);
    std::vector<ContactKeypoint> named(chosen.size());
    for (std::size_t i = 0; i < chosen.size(); ++i) named[i].smpl = chosen[i].smpl;
    chain.key_weight.assign(chosen.size(), 1.0);
    chain.key_object = object_weights(named);
  } else {
    add_listed_keypoints(robot, list, chosen, chain);
  }
  for (const FrameAndJoint& key : chosen) {
    chain.key_points.push_back(point(key.frame));
    chain.key_smpl.push_back(key.smpl);
  }
  return chain;
}

void forward(const PairChain& chain, const Eigen::Matrix3d& R_WB, const Eigen::Vector3d& p_WB,
             const Eigen::Ref<const Eigen::VectorXd>& q, ChainPose& pose) {
  const std::size_t links = chain.joints.size() + 1;
  pose.R_WL.resize(links);
  pose.p_WL.resize(links);
  pose.points.resize(3, static_cast<Eigen::Index>(chain.points.size()));
  pose.R_WL[0] = R_WB;
  pose.p_WL[0] = p_WB;
  for (std::size_t j = 0; j + 1 < links; ++j) {
    const ChainJoint& joint = chain.joints[j];
    const Eigen::Matrix3d& R_WP = pose.R_WL[joint.parent];
    const Eigen::Matrix3d R_at_zero = R_WP * joint.rotation;
    pose.p_WL[j + 1] = pose.p_WL[joint.parent] + R_WP * joint.offset;
    pose.R_WL[j + 1] =
        R_at_zero * Eigen::AngleAxisd(q[static_cast<Eigen::Index>(j)], Eigen::Vector3d::Unit(joint.axis));
  }
  for (std::size_t k = 0; k < chain.points.size(); ++k) {
    const ChainPoint& point = chain.points[k];
    pose.points.col(static_cast<Eigen::Index>(k)) = pose.p_WL[point.link] + pose.R_WL[point.link] * point.offset;
  }
}

namespace {

constexpr double kMostTilt = 0.6;  // forward and back, where the card has no bounds [rad]

ChainJoint tilt_joint(const RobotModel& robot) {
  ChainJoint tilt;
  tilt.axis = 1;
  tilt.lower = robot.root_bounds ? robot.root_bounds->min_pitch : -kMostTilt;
  tilt.upper = robot.root_bounds ? robot.root_bounds->max_pitch : kMostTilt;
  return tilt;
}

// The point on what remains of the robot, or -1 as its link where it moves with the legs. The origin of the first link
// of a leg does not.
ChainPoint kept_point(const PairChain& whole, const ChainPoint& point, const std::vector<int>& link_of) {
  if (link_of[point.link] >= 0) return {link_of[point.link], point.offset};
  const ChainJoint& joint = whole.joints[point.link - 1];
  if (link_of[joint.parent] >= 0 && point.offset.norm() < 1e-9) return {link_of[joint.parent], joint.offset};
  return {-1, Eigen::Vector3d::Zero()};
}

}  // namespace

UprightChain make_upright_chain(const RobotModel& robot, const PairChain& whole) {
  const std::vector<int> legs = leg_joints(robot);
  require(!legs.empty() && soles_of_feet(robot).size() == 2,
          "robot '{}': to stand on the ground, retargeting needs 'legs' and the soles of two feet in its "
          "card; take mode=paper for a robot without",
          robot.name);
  UprightChain out;
  out.chain.joints.push_back(tilt_joint(robot));
  out.robot_joint.push_back(-1);
  std::vector<int> link_of(robot.links.size(), -1);
  link_of[0] = 1;
  for (int j = 0; j < whole.dof(); ++j) {
    const int parent = link_of[whole.joints[j].parent];
    if (parent < 0 || std::find(legs.begin(), legs.end(), j) != legs.end()) continue;
    out.chain.joints.push_back(whole.joints[j]);
    out.chain.joints.back().parent = parent;
    out.robot_joint.push_back(j);
    link_of[j + 1] = out.chain.dof();
  }
  std::vector<int> point_of(whole.points.size(), -1);
  for (std::size_t i = 0; i < whole.points.size(); ++i) {
    const ChainPoint kept = kept_point(whole, whole.points[i], link_of);
    if (kept.link < 0) continue;
    point_of[i] = static_cast<int>(out.chain.points.size());
    out.chain.points.push_back(kept);
  }
  for (const int point : whole.pair_points) out.chain.pair_points.push_back(point_of[point]);
  for (const int point : whole.key_points) {
    require(point_of[point] >= 0,
            "robot '{}': an interaction keypoint lies on a leg below the hip; mode=grounded has no place "
            "for it",
            robot.name);
    out.chain.key_points.push_back(point_of[point]);
  }
  out.chain.key_smpl = whole.key_smpl;
  out.chain.key_weight = whole.key_weight;
  out.chain.key_object = whole.key_object;
  return out;
}

}  // namespace duet
