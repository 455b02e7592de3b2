#include "duet/retarget/solver/lane_problem.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace duet {
namespace {

using pair_kernel::kHumanRows;
using pair_kernel::kLanes;

void copy3(const Eigen::Vector3d& from, float* to) {
  for (int r = 0; r < 3; ++r) to[r] = static_cast<float>(from[r]);
}

pair_kernel::Joint pack_joint(const ChainJoint& joint) {
  pair_kernel::Joint out{};
  out.parent = joint.parent;
  out.axis = joint.axis;
  out.turned = joint.turned;
  copy3(joint.offset, out.offset);
  for (int i = 0; i < 9; ++i) out.rotation[i] = static_cast<float>(joint.rotation(i / 3, i % 3));
  return out;
}

void pack_ground(const PairProblem& problem, const PairOptions& options, pair_kernel::Setup& setup) {
  const BodySpheres& spheres = problem.spheres;
  setup.upright = problem.upright;
  setup.bones = problem.bones.size() > 0;
  setup.robot_spheres = static_cast<int>(spheres.robot_point.size());
  setup.human_spheres = static_cast<int>(spheres.human_offset.size());
  setup.sphere_pairs = static_cast<int>(spheres.pairs.size());
  setup.weighted = problem.chain.weighted();
  setup.objects = problem.object.count();
  setup.extended = setup.upright || setup.bones || setup.sphere_pairs > 0 || options.weights.partner > 0.0 ||
                   setup.weighted || setup.objects > 0 || problem.nearness.size() > 0 || !problem.rest.isZero(0.0);
  for (int k = 0; k < problem.chain.keys(); ++k) {
    setup.key_weight[k] = static_cast<float>(problem.chain.key_weight[k]);
    setup.key_object[k] = static_cast<float>(problem.chain.key_object[k]);
  }
  setup.object_row = pair_kernel::kHuman + 3 * problem.chain.keys() +
                     static_cast<int>(problem.distances.rows() + problem.bones.rows()) + 3 * setup.human_spheres;
  if (problem.nearness.size() > 0) setup.near_row = setup.object_row + setup.objects * (3 + 2 * problem.chain.keys());
  std::copy(spheres.robot_point.begin(), spheres.robot_point.end(), setup.sphere_point);
  std::copy(spheres.human_offset.begin(), spheres.human_offset.end(), setup.sphere_offset);
  for (int i = 0; i < setup.sphere_pairs; ++i)
    setup.sphere_pair[i] = {spheres.pairs[i].a, spheres.pairs[i].b, static_cast<float>(spheres.pairs[i].reach)};
}

pair_kernel::Setup pack_setup(const PairProblem& problem, const PairOptions& options) {
  const PairChain& chain = problem.chain;
  pair_kernel::Setup setup{};
  setup.dof = chain.dof();
  setup.points = static_cast<int>(chain.points.size());
  setup.keys = chain.keys();
  setup.mean_norm = options.kin_loss == KinLoss::kMeanNorm;
  setup.adapt_human = options.adapt_human;
  setup.per_frame_translation = options.root_translation == RootTranslation::kPerFrame;
  setup.rows = setup.dof + 3 + (setup.adapt_human ? kHumanRows : 0) + (setup.per_frame_translation ? 3 : 0);
  for (int j = 0; j < setup.dof; ++j) {
    setup.joints[j] = pack_joint(chain.joints[j]);
    setup.lower[j] = static_cast<float>(chain.joints[j].lower);
    setup.upper[j] = static_cast<float>(chain.joints[j].upper);
    setup.rest[j] = static_cast<float>(problem.rest[j]);
  }
  for (int k = 0; k < setup.points; ++k) {
    setup.point[k].link = chain.points[k].link;
    copy3(chain.points[k].offset, setup.point[k].offset);
  }
  std::copy(chain.pair_points.begin(), chain.pair_points.end(), setup.pair_point);
  std::copy(chain.key_points.begin(), chain.key_points.end(), setup.key_point);
  std::copy(problem.human_offset.begin(), problem.human_offset.end(), setup.human_offset);
  pack_ground(problem, options, setup);
  return setup;
}

}  // namespace

const pair_kernel::LaneKernel& lane_kernel(KernelKind kind) {
  switch (kind) {
#if defined(__x86_64__)
    case KernelKind::kV4:
      return pair_kernel::kV4;
    case KernelKind::kV3:
      return pair_kernel::kV3;
    case KernelKind::kV2:
      return pair_kernel::kV2;
#endif
    default:
      return pair_kernel::kPortable;
  }
}

bool kernel_fits(const PairProblem& problem) {
  const BodySpheres& spheres = problem.spheres;
  return problem.chain.dof() <= pair_kernel::kMaxJoints && problem.chain.points.size() <= pair_kernel::kMaxPoints &&
         problem.chain.keys() <= pair_kernel::kMaxKeys && spheres.robot_point.size() <= pair_kernel::kMaxSpheres &&
         spheres.human_offset.size() <= pair_kernel::kMaxHumanSpheres &&
         spheres.pairs.size() <= pair_kernel::kMaxSpherePairs;
}

LaneProblem::LaneProblem(const PairProblem& problem, const PairOptions& options, KernelKind kernel)
    : options_(options),
      kernel_(lane_kernel(kernel)),
      setup_(pack_setup(problem, options)),
      frames_(problem.frames()),
      blocks_((frames_ + kLanes - 1) / kLanes),
      constant_rows_(setup_.object_row + setup_.objects * (3 + 2 * setup_.keys) +
                     static_cast<int>(problem.nearness.rows())),
      rows_in_time_(setup_.extended && setup_.adapt_human ? setup_.dof + 3 + kHumanRows : setup_.dof) {
  constants_.resize(static_cast<std::size_t>(blocks_) * constant_rows_);
  for (int block = 0; block < blocks_; ++block) {
    for (int lane = 0; lane < kLanes; ++lane) pack_frame(problem, block, lane);
  }
}

// Padding frames repeat the last frame with weight zero: finite, and without influence.
void LaneProblem::pack_frame(const PairProblem& problem, int block, int lane) {
  pair_kernel::Row* rows = &constants_[static_cast<std::size_t>(block) * constant_rows_];
  const int t = lane * blocks_ + block;
  const int source = std::min(t, frames_ - 1);
  const auto set = [&](int row, double value) { rows[row].lane[lane] = static_cast<float>(value); };
  const auto edge = [&](int from) { return from >= 0 && from + 1 < frames_ ? 1.0 : 0.0; };
  const auto bend = [&](int middle) { return middle >= 1 && middle + 1 < frames_ ? 1.0 : 0.0; };
  const bool inside = t < frames_;
  set(pair_kernel::kWeight, inside ? 1.0 : 0.0);
  set(pair_kernel::kEdgeBefore, inside ? edge(t - 1) : 0.0);
  set(pair_kernel::kEdgeAfter, edge(t));
  set(pair_kernel::kBendBefore, inside ? bend(t - 1) : 0.0);
  set(pair_kernel::kBend, bend(t));
  set(pair_kernel::kBendAfter, bend(t + 1));
  set(pair_kernel::kCosYaw, std::cos(problem.yaw[source]));
  set(pair_kernel::kSinYaw, std::sin(problem.yaw[source]));
  const Eigen::Matrix3Xd targets = problem.targets.frame(source).colwise() - problem.root.col(source);
  for (int i = 0; i < 3 * kRetargetPairs; ++i) set(pair_kernel::kTarget + i, targets.data()[i]);
  const Eigen::Matrix3Xd human = problem.human.frame(source).colwise() - problem.root.col(source);
  for (int i = 0; i < 3 * setup_.keys; ++i) set(pair_kernel::kHuman + i, human.data()[i]);
  const int first = pair_kernel::kHuman + 3 * setup_.keys;
  for (int i = 0; i < problem.distances.rows(); ++i) set(first + i, problem.distances(i, source));
  int row = first + static_cast<int>(problem.distances.rows());
  for (int i = 0; i < problem.bones.rows(); ++i) set(row++, problem.bones(i, source));
  if (setup_.human_spheres > 0) {
    const Eigen::Matrix3Xd spheres = problem.spheres.human.frame(source).colwise() - problem.root.col(source);
    for (int i = 0; i < 3 * setup_.human_spheres; ++i) set(row++, spheres.data()[i]);
  }
  const int keys = setup_.keys;
  for (int i = 0; i < problem.nearness.rows(); ++i)
    set(setup_.near_row + i,
        problem.nearness(i, source) * problem.chain.key_weight[i / keys] * problem.chain.key_weight[i % keys]);
  if (setup_.objects == 0) return;
  const Eigen::Matrix3Xd object = problem.object.points.frame(source).colwise() - problem.root.col(source);
  for (int i = 0; i < 3 * setup_.objects; ++i) set(row++, object.data()[i]);
  for (int i = 0; i < problem.object.distances.rows(); ++i) set(row++, problem.object.distances(i, source));
}

// The kernel's gradient is that of T times the objective: of the size of one frame's, whatever the length.
pair_kernel::Step LaneProblem::make_step(const PairWeights& w, const Eigen::Array3d& offset) const {
  const ContactFactors contact = contact_factors(options_, setup_.keys);
  const double frames = frames_;
  pair_kernel::Step step{};
  step.kin = static_cast<float>(setup_.mean_norm ? w.kin / kRetargetPairs : 2.0 * w.kin);
  step.con_robot = static_cast<float>(4.0 * w.con * contact.all * contact.robot);
  step.con_cross = static_cast<float>(4.0 * w.con * contact.all * contact.cross);
  step.con_human = static_cast<float>(4.0 * w.con * contact.all * contact.human);
  step.hum = static_cast<float>(2.0 * w.hum);
  step.pose = static_cast<float>(2.0 * w.pose / setup_.dof);
  step.velocity = static_cast<float>(2.0 * w.temp * frames / (frames - 1.0));
  step.acceleration = static_cast<float>(2.0 * w.temp * w.acceleration * frames / (frames - 2.0));
  step.bone = static_cast<float>(2.0 * w.bone);
  step.collision = static_cast<float>(2.0 * w.collision);
  const ObjectFactors object = object_factors(options_, setup_.keys);
  step.object_robot = static_cast<float>(4.0 * w.con * w.object * object.robot);
  step.object_human = static_cast<float>(4.0 * w.con * w.object * object.human);
  step.partner_velocity = static_cast<float>(w.partner * 2.0 * w.temp * frames / (frames - 1.0));
  step.partner_acceleration = static_cast<float>(w.partner * 2.0 * w.temp * w.acceleration * frames / (frames - 2.0));
  for (int r = 0; r < 3; ++r) step.offset[r] = static_cast<float>(offset[r]);
  return step;
}

LaneProblem::Sums LaneProblem::sweep(pair_kernel::Sweep sweep, const pair_kernel::Step& step) const {
  Sums total{};
  sweep.setup = &setup_;
  sweep.step = &step;
  sweep.constants = constants_.data();
  sweep.constant_rows = static_cast<std::size_t>(constant_rows_);
  sweep.rows = rows();
  for (int begin = 0; begin < blocks_; begin += kBlocksPerSum) {
    std::array<pair_kernel::Row, pair_kernel::kSums> sums{};
    sweep.begin = begin;
    sweep.end = std::min(begin + kBlocksPerSum, blocks_);
    sweep.sums = sums.data();
    kernel_.sweep(sweep);
    // A fixed order: the result does not depend on the width of the kernel.
    for (int i = 0; i < pair_kernel::kSums; ++i) {
      for (const float value : sums[i].lane) total[i] += value;
    }
  }
  return total;
}

PairTerms LaneProblem::terms(const Sums& sums, const PairWeights& weights) const {
  const ContactFactors contact = contact_factors(options_, setup_.keys);
  const double frames = frames_;
  PairTerms out;
  out.kin = sums[pair_kernel::kKin] / (setup_.mean_norm ? kRetargetPairs * frames : frames);
  out.con = 2.0 * contact.all / frames *
            (contact.robot * sums[pair_kernel::kConRobot] + contact.cross * sums[pair_kernel::kConCross] +
             contact.human * sums[pair_kernel::kConHuman]);
  out.hum = sums[pair_kernel::kHum] / frames;
  out.temp = sums[pair_kernel::kVelocity] / (frames - 1.0) +
             weights.acceleration * sums[pair_kernel::kAcceleration] / (frames - 2.0);
  out.pose = sums[pair_kernel::kPose] / (frames * setup_.dof);
  out.bone = sums[pair_kernel::kBone] / frames;
  out.collision = sums[pair_kernel::kCollision] / frames;
  const ObjectFactors object = object_factors(options_, setup_.keys);
  out.object =
      2.0 / frames * (object.robot * sums[pair_kernel::kObjectRobot] + object.human * sums[pair_kernel::kObjectHuman]);
  out.partner = sums[pair_kernel::kPartnerVelocity] / (frames - 1.0) +
                weights.acceleration * sums[pair_kernel::kPartnerAcceleration] / (frames - 2.0);
  return out;
}

void LaneProblem::fill_halo(Rows& x) const {
  for (const int b : {-2, -1, blocks_, blocks_ + 1}) {
    const int shift = b < 0 ? -((-b + blocks_ - 1) / blocks_) : b / blocks_;
    const int source = b - shift * blocks_;
    const pair_kernel::Row* from = &x[static_cast<std::size_t>(source + pair_kernel::kHalo) * setup_.rows];
    pair_kernel::Row* to = &x[static_cast<std::size_t>(b + pair_kernel::kHalo) * setup_.rows];
    for (int j = 0; j < rows_in_time_; ++j) {
      to[j] = pair_kernel::Row{};
      const std::span<const float> lanes(from[j].lane);
      if (shift < 0) {
        std::copy(lanes.begin(), lanes.end() + shift, to[j].lane - shift);
      } else {
        std::copy(lanes.begin() + shift, lanes.end(), to[j].lane);
      }
    }
  }
}

LaneProblem::Rows LaneProblem::rows_at_rest(const PairProblem& problem) const {
  Rows x = make_rows_with_halo();
  for (int block = 0; block < blocks_; ++block) {
    for (int j = 0; j < setup_.dof; ++j) {
      float* lanes = x[static_cast<std::size_t>(block + pair_kernel::kHalo) * setup_.rows + j].lane;
      std::fill(lanes, lanes + kLanes, static_cast<float>(problem.rest[j]));
    }
  }
  fill_halo(x);
  return x;
}

PairVariables LaneProblem::variables(const Rows& x, const Eigen::Array3d& offset) const {
  PairVariables out = PairVariables::zero(setup_.dof, frames_);
  for (int t = 0; t < frames_; ++t) {
    const pair_kernel::Row* rows = &x[static_cast<std::size_t>(t % blocks_ + pair_kernel::kHalo) * setup_.rows];
    const int lane = t / blocks_;
    for (int i = 0; i < setup_.rows; ++i) out.frames(variable_of(i), t) = rows[i].lane[lane];
  }
  out.offset = offset;
  return out;
}

int LaneProblem::variable_of(int row) const {
  const bool translation = setup_.per_frame_translation && row >= setup_.rows - 3;
  return translation ? setup_.dof + 3 + kHumanRows + row - (setup_.rows - 3) : row;
}

}  // namespace duet
