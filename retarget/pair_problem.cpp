#include "duet/retarget/pair_problem.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/retarget/pair_chain.h"
#include "duet/retarget/reshape.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

constexpr int kMinFrames = 5;  // the shortest sequence with an acceleration term that does not touch both ends

std::array<double, kRetargetPairs> target_lengths(const PairChain& chain, const PairTree& tree,
                                                  const PairOptions& options) {
  const PairBones bones = robot_bones(chain, tree);
  if (options.smpl_path.empty()) return bones.length;
  return fit_shape(load_shape_basis(options.smpl_path), tree, bones).length;
}

// Distances between the keypoints of the two original persons.
Eigen::MatrixXd original_distances(const PointTracks& source, const PointTracks& partner) {
  const int keys = source.points();
  const int points = 2 * keys;
  Eigen::MatrixXd distances(points * (points - 1) / 2, source.frames());
  Eigen::Matrix3Xd x(3, points);
  for (int t = 0; t < source.frames(); ++t) {
    x << source.frame(t), partner.frame(t);
    Eigen::Index row = 0;
    for (int i = 0; i < points; ++i) {
      for (int j = i + 1; j < points; ++j) distances(row++, t) = (x.col(i) - x.col(j)).norm();
    }
  }
  return distances;
}

// Smooth from 1 at half of `range` to 0 at it.
double nearness_of(double distance, double range) {
  const double s = std::clamp(2.0 * (1.0 - distance / range), 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}

constexpr double kTrunkRange = 0.5;  // of the range: two who stand before one another to bow are farther apart

bool is_of_an_arm(int smpl) { return smpl >= kLeftElbow && smpl <= kRightHand; }

// Distances between arms count up to `range`, those of heads, shoulders and hips to half of it.
Eigen::MatrixXd find_nearness(const Eigen::MatrixXd& distances, const std::vector<int>& smpl, double range) {
  const int keys = static_cast<int>(smpl.size());
  Eigen::MatrixXd nearness(Eigen::Index{keys} * keys, distances.cols());
  Eigen::Index row = 0;
  for (int i = 0; i < keys; ++i) {
    row += keys - 1 - i;  // the robot's own
    for (int j = 0; j < keys; ++j, ++row) {
      const double own = (is_of_an_arm(smpl[i]) && is_of_an_arm(smpl[j]) ? 1.0 : kTrunkRange) * range;
      for (Eigen::Index t = 0; t < distances.cols(); ++t)
        nearness(Eigen::Index{i} * keys + j, t) = nearness_of(distances(row, t), own);
    }
  }
  return nearness;
}

Eigen::VectorXd rest_of(const RobotModel& robot, const PairProblem& problem, RestPose pose) {
  Eigen::VectorXd rest = Eigen::VectorXd::Zero(problem.chain.dof());
  if (pose == RestPose::kZero) return rest;
  for (int j = 0; j < problem.chain.dof(); ++j) {
    const int joint = problem.upright ? problem.robot_joint[j] : j;
    if (joint >= 0) rest[j] = robot.neutral[joint];
  }
  return rest;
}

// The robot stands: its base and soles are planned, the rest is a chain above the base, and the reshaped person hangs
// on the planned base.
void weigh_hands(double weight, PairChain& chain) {
  for (int k = 0; k < chain.keys(); ++k)
    if (chain.key_smpl[k] == kLeftHand || chain.key_smpl[k] == kRightHand) chain.key_weight[k] = weight;
}

void stand_on_ground(const RobotModel& robot, const HumanMotion& source, const HumanMotion& partner,
                     const PairTree& tree, const PairOptions& options, PairProblem& problem) {
  UprightChain upright = make_upright_chain(robot, problem.chain);
  if (options.weights.collision > 0.0) problem.spheres = make_body_spheres(robot, upright, partner);
  problem.chain = upright.chain;
  problem.robot_joint = upright.robot_joint;
  problem.upright = true;
  problem.reshaped = problem.targets;
  problem.plan = plan_ground(robot, LegPose(robot), source, tree, problem.targets,
                             {.smoothing = options.root_smoothing, .step_speed = options.step_speed});
  problem.yaw = problem.plan.yaw;
  problem.root = problem.plan.base;
  const Eigen::Vector3d p_BPelvis = pelvis_in_base(robot, robot.neutral).p;
  for (int t = 0; t < problem.frames(); ++t) {
    const Eigen::Vector3d pelvis = problem.root.col(t) + yaw_rotation(problem.yaw[t]) * p_BPelvis;
    problem.targets.frame(t).colwise() += Eigen::Vector3d(pelvis - problem.targets.at(t, 0));
  }
}

}  // namespace

PairProblem make_pair_problem(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options) {
  const HumanMotion& source = clip.reactor_motion();
  const HumanMotion& partner = clip.actor_motion();
  require(source.frames() >= kMinFrames, "clip '{}': retargeting needs at least {} frames at 50 Hz, found {}", clip.id,
          kMinFrames, source.frames());
  PairProblem problem;
  problem.chain = make_chain(robot, options.keypoints, options.keypoint_list);
  if (options.keypoint_list.empty()) weigh_hands(options.weights.hand, problem.chain);
  const PairTree tree = make_pair_tree(robot);
  problem.targets = reshape(source, tree, target_lengths(problem.chain, tree, options),
                            height_scale(robot, problem.chain, tree, source));
  problem.yaw.resize(source.frames());
  problem.root.resize(3, source.frames());
  const Eigen::Vector3d p_BPelvis = pelvis_in_base(robot, robot.neutral).p;
  for (int t = 0; t < source.frames(); ++t) {
    problem.yaw[t] = heading(source.joints, t);
    problem.root.col(t) = problem.targets.at(t, 0);
    if (!base_is_pelvis(robot)) problem.root.col(t) -= yaw_rotation(problem.yaw[t]) * p_BPelvis;
  }
  if (options.ground) stand_on_ground(robot, source, partner, tree, options, problem);
  problem.human = partner.joints.select(problem.chain.key_smpl);
  for (const int smpl : problem.chain.key_smpl) problem.human_offset.push_back(human_offset_of(smpl));
  problem.distances = original_distances(source.joints.select(problem.chain.key_smpl), problem.human);
  problem.rest = rest_of(robot, problem, options.rest_pose);
  if (options.contact_range > 0.0)
    problem.nearness = find_nearness(problem.distances, problem.chain.key_smpl, options.contact_range);
  if (options.weights.object > 0.0)
    problem.object = make_object_keypoints(clip.object, source.joints.select(problem.chain.key_smpl), problem.human);
  if (options.weights.bone > 0.0) problem.bones = arm_bones(partner);
  return problem;
}

namespace {

// exp of a rotation vector and the coefficients of its left Jacobian J = a I + b [w]x + c w w^T.
struct RotationMap {
  double a = 1.0, b = 0.5, c = 1.0 / 6.0;
};

RotationMap rotation_map(const Eigen::Vector3d& w) {
  const double square = w.squaredNorm();
  if (square < 1e-8) return {1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0};
  const double angle = std::sqrt(square);
  const double a = std::sin(angle) / angle;
  return {a, (1.0 - std::cos(angle)) / square, (1.0 - a) / square};
}

// Everything about one frame that its terms and their gradients share.
struct FrameWork {
  ChainPose pose;
  Eigen::Matrix3Xd point_force;  // d objective / d point
  Eigen::Matrix3Xd keys;         // 2 K keypoints, robot's first
  Eigen::Matrix3Xd key_force;
  std::vector<Eigen::Vector3d> force, moment;  // per link, about the world's origin
};

struct Scales {
  PairWeights weights;
  ContactFactors contact;
  ObjectFactors object;
  KinLoss kin_loss = KinLoss::kSquared;
  double frames = 1.0;
};

double kin_term(const PairProblem& problem, const Scales& s, int t, FrameWork& work) {
  double sum = 0.0;
  for (int i = 0; i < kRetargetPairs; ++i) {
    const int point = problem.chain.pair_points[i];
    if (point < 0) continue;
    const Eigen::Vector3d d = work.pose.points.col(point) - problem.targets.at(t, i);
    if (s.kin_loss == KinLoss::kSquared) {
      sum += d.squaredNorm() / s.frames;
      work.point_force.col(point) += 2.0 * s.weights.kin / s.frames * d;
    } else {
      const double norm = std::sqrt(d.squaredNorm() + kDistanceGuard);
      const double share = 1.0 / (kRetargetPairs * s.frames);
      sum += share * norm;
      work.point_force.col(point) += s.weights.kin * share / norm * d;
    }
  }
  return sum;
}

double con_term(const PairProblem& problem, const Scales& s, int t, FrameWork& work) {
  const int keys = problem.chain.keys();
  double sum = 0.0;
  Eigen::Index row = 0;
  work.key_force.setZero(3, 2L * keys);
  for (int i = 0; i < 2 * keys; ++i) {
    for (int j = i + 1; j < 2 * keys; ++j, ++row) {
      const double own = problem.chain.key_weight[i % keys] * problem.chain.key_weight[j % keys];
      const double factor =
          (j < keys   ? s.contact.robot
           : i < keys ? s.contact.cross
                      : s.contact.human) *
          s.contact.all * own *
          (i < keys && j >= keys && problem.nearness.size() > 0 ? problem.nearness(Eigen::Index{i} * keys + j - keys, t)
                                                                : 1.0);
      if (factor == 0.0) continue;
      const Eigen::Vector3d d = work.keys.col(i) - work.keys.col(j);
      const double distance = std::sqrt(d.squaredNorm() + kDistanceGuard);
      const double error = distance - problem.distances(row, t);
      sum += 2.0 * factor / s.frames * error * error;  // both triangles of the matrix
      const Eigen::Vector3d force = 4.0 * s.weights.con * factor / s.frames * error / distance * d;
      work.key_force.col(i) += force;
      work.key_force.col(j) -= force;
    }
  }
  return sum;
}

void place_keypoints(const PairProblem& problem, int t, const Eigen::Ref<const Eigen::VectorXd>& x, FrameWork& work) {
  const int keys = problem.chain.keys();
  const int first = problem.chain.dof() + 3;
  work.keys.resize(3, 2L * keys);
  for (int k = 0; k < keys; ++k) {
    work.keys.col(k) = work.pose.points.col(problem.chain.key_points[k]);
    work.keys.col(keys + k) = problem.human.at(t, k);
    const int offset = problem.human_offset[k];
    if (offset >= 0) work.keys.col(keys + k) += x.segment<3>(first + 3 * offset);
  }
}

// Pulls forces on points back to joints, root rotation and root position.
void pull_back(const PairProblem& problem, const Eigen::Vector3d& w, FrameWork& work, Eigen::Ref<Eigen::VectorXd> g,
               Eigen::Vector3d& root_force) {
  const PairChain& chain = problem.chain;
  work.force.assign(chain.joints.size() + 1, Eigen::Vector3d::Zero());
  work.moment.assign(chain.joints.size() + 1, Eigen::Vector3d::Zero());
  for (std::size_t k = 0; k < chain.points.size(); ++k) {
    const Eigen::Vector3d force = work.point_force.col(static_cast<Eigen::Index>(k));
    const Eigen::Vector3d p = work.pose.points.col(static_cast<Eigen::Index>(k));
    work.force[chain.points[k].link] += force;
    work.moment[chain.points[k].link] += p.cross(force);
  }
  for (int j = chain.dof() - 1; j >= 0; --j) {
    const ChainJoint& joint = chain.joints[j];
    const Eigen::Vector3d axis = work.pose.R_WL[j + 1].col(joint.axis);
    const Eigen::Vector3d& p = work.pose.p_WL[j + 1];
    g[j] += axis.dot(work.moment[j + 1] - p.cross(work.force[j + 1]));
    work.force[joint.parent] += work.force[j + 1];
    work.moment[joint.parent] += work.moment[j + 1];
  }
  root_force = work.force[0];
  const Eigen::Vector3d torque = work.moment[0] - work.pose.p_WL[0].cross(root_force);
  const RotationMap map = rotation_map(w);
  g.segment<3>(chain.dof()) += map.a * torque - map.b * w.cross(torque) + map.c * w.dot(torque) * w;
}

// The partner's arm bones; their gradient by his offsets is added to g (18 rows).
double bone_term(const PairProblem& problem, const Scales& s, int t, const Eigen::Ref<const Eigen::VectorXd>& offsets,
                 Eigen::Ref<Eigen::VectorXd> g) {
  if (problem.bones.size() == 0) return 0.0;
  double sum = 0.0;
  for (int k = 0; k < kArmBones; ++k) {
    const int begin = bone_begin(k);
    const Eigen::Vector3d before = problem.bones.block<3, 1>(3 * k, t);
    Eigen::Vector3d bone = before + offsets.segment<3>(3 * k);
    if (begin >= 0) bone -= offsets.segment<3>(3 * begin);
    const double length = std::sqrt(bone.squaredNorm() + kDistanceGuard);
    const double error = length - before.norm();
    sum += error * error / s.frames;
    const Eigen::Vector3d force = 2.0 * s.weights.bone / s.frames * error / length * bone;
    g.segment<3>(3 * k) += force;
    if (begin >= 0) g.segment<3>(3 * begin) -= force;
  }
  return sum;
}

// Spheres of the robot in themselves and in the partner's; forces go to the robot's points and to his offsets.
double collision_term(const PairProblem& problem, const Scales& s, int t, FrameWork& work,
                      const Eigen::Ref<const Eigen::VectorXd>& offsets, Eigen::Ref<Eigen::VectorXd> g) {
  const BodySpheres& spheres = problem.spheres;
  const int robots = static_cast<int>(spheres.robot_point.size());
  const auto at = [&](int i) -> Eigen::Vector3d {
    if (i < robots) return work.pose.points.col(spheres.robot_point[i]);
    const int offset = spheres.human_offset[i - robots];
    Eigen::Vector3d p = spheres.human.at(t, i - robots);
    if (offset >= 0) p += offsets.segment<3>(3L * offset);
    return p;
  };
  const auto push = [&](int i, const Eigen::Vector3d& force) {
    if (i < robots) {
      work.point_force.col(spheres.robot_point[i]) += force;
    } else if (spheres.human_offset[i - robots] >= 0) {
      g.segment<3>(3L * spheres.human_offset[i - robots]) += force;
    }
  };
  double sum = 0.0;
  for (const SpherePair& pair : spheres.pairs) {
    const Eigen::Vector3d d = at(pair.a) - at(pair.b);
    const double square = d.squaredNorm() + kDistanceGuard;
    if (square >= pair.reach * pair.reach) continue;
    const double distance = std::sqrt(square);
    const double depth = pair.reach - distance;
    sum += depth * depth / s.frames;
    const Eigen::Vector3d force = -2.0 * s.weights.collision / s.frames * depth / distance * d;
    push(pair.a, force);
    push(pair.b, -force);
  }
  return sum;
}

// kin, con, hum and pose of one frame; their gradient is added to that frame's column.
PairTerms frame_terms(const PairProblem& problem, const PairOptions& options, const Scales& s, const PairVariables& x,
                      int t, FrameWork& work, PairVariables* gradient) {
  const int dof = problem.chain.dof();
  const int keys = problem.chain.keys();
  const Eigen::VectorXd column = x.frames.col(t);
  const Eigen::Vector3d w = column.segment<3>(dof);
  const Eigen::Vector3d p_WB = problem.root.col(t) + x.offset + column.tail<3>();
  forward(problem.chain, root_rotation(problem.yaw[t], w), p_WB, column.head(dof), work.pose);
  work.point_force.setZero(3, work.pose.points.cols());
  place_keypoints(problem, t, column, work);

  PairTerms terms;
  terms.kin = kin_term(problem, s, t, work);
  terms.con = con_term(problem, s, t, work);
  if (problem.object.count() > 0)
    terms.object = object_term(problem.object, problem.chain, s.object, s.weights.con * s.weights.object, t, work.keys,
                               work.key_force);
  const auto offsets = column.segment<3 * kHumanOffsets>(dof + 3);
  terms.hum = offsets.squaredNorm() / s.frames;
  const Eigen::VectorXd bent = column.head(dof) - problem.rest;
  terms.pose = bent.squaredNorm() / (s.frames * dof);
  Eigen::VectorXd g_arms = Eigen::VectorXd::Zero(3 * kHumanOffsets);
  terms.bone = bone_term(problem, s, t, offsets, g_arms);
  terms.collision = collision_term(problem, s, t, work, offsets, g_arms);
  if (gradient == nullptr) return terms;

  Eigen::VectorXd g = Eigen::VectorXd::Zero(column.size());
  g.head(dof) = 2.0 * s.weights.pose / (s.frames * dof) * bent;
  for (int k = 0; k < keys; ++k) work.point_force.col(problem.chain.key_points[k]) += work.key_force.col(k);
  Eigen::Vector3d root_force;
  pull_back(problem, w, work, g, root_force);
  if (options.adapt_human) {
    g.segment<3 * kHumanOffsets>(dof + 3) = g_arms + 2.0 * s.weights.hum / s.frames * offsets;
    for (int k = 0; k < keys; ++k) {
      const int offset = problem.human_offset[k];
      if (offset >= 0) g.segment<3>(dof + 3 + 3L * offset) += work.key_force.col(keys + k);
    }
  }
  if (options.root_translation == RootTranslation::kPerFrame) g.tail<3>() = root_force;
  if (options.root_translation == RootTranslation::kConstantOffset) gradient->offset += root_force;
  if (problem.upright) {
    g.segment<3>(dof).setZero();
    gradient->offset.z() = 0.0;
  }
  gradient->frames.col(t) += g;
  return terms;
}

// Velocities and accelerations of `count` rows from `first`, times `share` in the gradient.
double temporal_term(const PairWeights& weights, const PairVariables& x, int first, int count, double share,
                     PairVariables* gradient) {
  const Eigen::Index frames = x.frames.cols();
  const auto q = x.frames.middleRows(first, count);
  const Eigen::MatrixXd v = q.rightCols(frames - 1) - q.leftCols(frames - 1);
  const Eigen::MatrixXd a = v.rightCols(frames - 2) - v.leftCols(frames - 2);
  const double per_v = 1.0 / static_cast<double>(frames - 1);
  const double per_a = weights.acceleration / static_cast<double>(frames - 2);
  if (gradient != nullptr) {
    auto g = gradient->frames.middleRows(first, count);
    const double gv = 2.0 * weights.temp * share * per_v;
    const double ga = 2.0 * weights.temp * share * per_a;
    g.rightCols(frames - 1) += gv * v;
    g.leftCols(frames - 1) -= gv * v;
    g.rightCols(frames - 2) += ga * a;
    g.middleCols(1, frames - 2) -= 2.0 * ga * a;
    g.leftCols(frames - 2) += ga * a;
  }
  return per_v * v.squaredNorm() + per_a * a.squaredNorm();
}

}  // namespace

ContactFactors contact_factors(const PairOptions& options, int keys) {
  ContactFactors f;
  if (options.contact_blocks != ContactBlocks::kFull) f.robot = 0.0;
  if (options.contact_blocks == ContactBlocks::kCross) f.human = 0.0;
  if (options.contact_reduction == ContactReduction::kMean) f.all = 1.0 / (4.0 * keys * keys);
  return f;
}

ObjectFactors object_factors(const PairOptions& options, int keys) {
  const ContactFactors f = contact_factors(options, keys);
  return {f.cross * f.all, options.adapt_human ? f.human * f.all : 0.0};
}

PairTerms evaluate(const PairProblem& problem, const PairOptions& options, const PairWeights& weights,
                   const PairVariables& x, PairVariables* gradient) {
  const double frames = problem.frames();
  ObjectFactors object = object_factors(options, problem.chain.keys());
  object = {object.robot / frames, object.human / frames};
  const Scales scales{weights, contact_factors(options, problem.chain.keys()), object, options.kin_loss, frames};
  if (gradient != nullptr) *gradient = PairVariables::zero(problem.chain.dof(), problem.frames());
  PairTerms sum;
  FrameWork work;
  for (int t = 0; t < problem.frames(); ++t) {
    const PairTerms terms = frame_terms(problem, options, scales, x, t, work, gradient);
    sum.kin += terms.kin;
    sum.con += terms.con;
    sum.hum += terms.hum;
    sum.pose += terms.pose;
    sum.bone += terms.bone;
    sum.collision += terms.collision;
    sum.object += terms.object;
  }
  const int dof = problem.chain.dof();
  sum.temp = temporal_term(weights, x, 0, dof, 1.0, gradient);
  if (weights.partner > 0.0 && options.adapt_human)
    sum.partner = temporal_term(weights, x, dof + 3, 3 * kHumanOffsets, weights.partner, gradient);
  return sum;
}

Eigen::Matrix3d root_rotation(double yaw, const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  Eigen::Matrix3d heading = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  if (angle < 1e-12) return heading;
  return Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix() * heading;
}

}  // namespace duet
