#include "duet/retarget/ground_plan.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/recording.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

constexpr double kRate = 50.0;
constexpr double kReach = 0.975;         // of a straight leg: short of where a knee has no slope
constexpr double kReachSlack = 1e-4;     // [m]
constexpr double kMostCrouch = 0.08;     // that a long step may take from the base's height [m]
constexpr double kStandingBand = 0.05;   // a person's pelvis this little below its standing height stands [m]
constexpr double kStepHeight = 0.03;     // a swinging sole clears the floor by this at least [m]
constexpr double kEase = 8.0;            // frames in which a swing leaves the straight line
constexpr double kLeastStepTime = 0.24;  // [s]
constexpr double kLeastSide = 0.07;      // of a sole from the middle, so that the feet do not meet [m]
constexpr double kMostSide = 0.25;
constexpr double kMostFootTurn = 0.6;  // of a sole against the base [rad]

int index_of_pair(const PairTree& tree, int smpl) {
  return static_cast<int>(std::find(tree.smpl.begin(), tree.smpl.end(), smpl) - tree.smpl.begin());
}

void unwrap(Eigen::VectorXd& angle) {
  for (Eigen::Index t = 1; t < angle.size(); ++t)
    angle[t] = angle[t - 1] + std::remainder(angle[t] - angle[t - 1], 2.0 * std::numbers::pi);
}

Eigen::VectorXd smooth_angle(Eigen::VectorXd angle, double sigma) {
  unwrap(angle);
  return smoothed(angle.transpose(), sigma).transpose();
}

// Height of the base: the robot's standing height, less what the person bends his knees.
Eigen::VectorXd standing_heights(const RobotModel& robot, const PointTracks& reshaped, double sigma) {
  const int frames = reshaped.frames();
  Eigen::VectorXd pelvis(frames);
  for (int t = 0; t < frames; ++t) pelvis[t] = reshaped.at(t, 0).z();
  Eigen::VectorXd sorted = pelvis;
  std::sort(sorted.begin(), sorted.end());
  const double standing = sorted[(frames - 1) * 9 / 10];
  for (double& z : pelvis) z = std::min(0.0, z - standing + kStandingBand);
  return robot.standing_height + smoothed(pelvis.transpose(), 2.0 * sigma).transpose().array();
}

void plan_base(const RobotModel& robot, const HumanMotion& source, const PointTracks& reshaped, double sigma,
               GroundPlan& plan) {
  const int frames = reshaped.frames();
  plan.base.resize(3, frames);
  plan.yaw.resize(frames);
  for (int t = 0; t < frames; ++t) {
    plan.yaw[t] = heading(source.joints, t);
    plan.base.col(t) = reshaped.at(t, 0);
  }
  plan.yaw = smooth_angle(plan.yaw, sigma);
  plan.base = smoothed(plan.base, sigma);
  plan.base.row(2) = standing_heights(robot, reshaped, sigma).transpose();
  if (base_is_pelvis(robot)) return;
  const Eigen::Vector3d p_BPelvis = pelvis_in_base(robot, robot.neutral).p;
  for (int t = 0; t < frames; ++t) {
    const Eigen::Vector3d p = yaw_rotation(plan.yaw[t]) * p_BPelvis;
    plan.base.col(t).head<2>() -= p.head<2>();
  }
}

// The soles under the reshaped feet, seen from the base: kept apart, and on the ground where the person's foot is at
// its lowest.
void follow_feet(const LegPose& legs, const PairTree& tree, const PointTracks& reshaped, double sigma,
                 GroundPlan& plan) {
  const int frames = reshaped.frames();
  for (int side = 0; side < 2; ++side) {
    const int ankle = index_of_pair(tree, side == 0 ? kLeftAnkle : kRightAnkle);
    const int toe = index_of_pair(tree, side == 0 ? kLeftToe : kRightToe);
    plan.sole[side].resize(3, frames);
    plan.turn[side].resize(frames);
    Eigen::VectorXd turn(frames);
    for (int t = 0; t < frames; ++t) {
      const Eigen::Vector3d foot = reshaped.at(t, toe) - reshaped.at(t, ankle);
      turn[t] = std::atan2(foot.y(), foot.x()) - plan.yaw[t];
      turn[t] = std::clamp(std::remainder(turn[t], 2.0 * std::numbers::pi), -kMostFootTurn, kMostFootTurn);
    }
    turn = smoothed(turn.transpose(), sigma).transpose();
    for (int t = 0; t < frames; ++t) {
      plan.turn[side][t] = plan.yaw[t] + turn[t];
      plan.sole[side].col(t) = reshaped.at(t, ankle);
    }
    plan.sole[side] = smoothed(plan.sole[side], 0.05 * kRate);
    std::vector<double> heights(plan.sole[side].row(2).begin(), plan.sole[side].row(2).end());
    std::nth_element(heights.begin(), heights.begin() + frames / 10, heights.end());
    const double floor = heights[frames / 10];
    const Eigen::Vector3d middle = yaw_rotation(0.0) * legs.sole(side);
    for (int t = 0; t < frames; ++t) {
      Eigen::Vector3d p = plan.sole[side].col(t);
      p += yaw_rotation(plan.turn[side][t]) * Eigen::Vector3d(middle.x(), 0.0, 0.0);
      Eigen::Vector3d seen = yaw_rotation(-plan.yaw[t]) * (p - plan.base.col(t));
      const double sign = side == 0 ? 1.0 : -1.0;
      seen.y() = sign * std::clamp(sign * seen.y(), kLeastSide, kMostSide);
      p.head<2>() = (plan.base.col(t) + yaw_rotation(plan.yaw[t]) * seen).head<2>();
      p.z() = std::max(0.0, p.z() - floor);
      plan.sole[side].col(t) = p;
    }
  }
}

// Horizontal distance from hip to ankle that a leg spans at the base's least height.
double longest_step(const LegPose& legs, int side, double base_height) {
  const double drop = base_height - kMostCrouch + legs.hip(side).z() - legs.ankle_height(side);
  const double reach = kReach * legs.length(side);
  return reach > drop ? std::sqrt(reach * reach - drop * drop) : 0.0;
}

// From hip to ankle in the ground plane where the sole stands at `p`, turned by `turn`.
Eigen::Vector2d step_of(const GroundPlan& plan, const LegPose& legs, int side, int t, const Eigen::Vector3d& p,
                        double turn) {
  const Eigen::Vector3d hip = plan.base.col(t) + yaw_rotation(plan.yaw[t]) * legs.hip(side);
  const Eigen::Vector3d ankle = p - yaw_rotation(turn) * Eigen::Vector3d(legs.sole(side).x(), 0.0, 0.0);
  return (ankle - hip).head<2>();
}

struct Standing {
  int begin = 0, end = 0;
  Eigen::Vector3d p;
  double turn = 0.0;
};

void place(const GroundPlan& plan, int side, Standing& standing) {
  standing.p.setZero();
  standing.turn = 0.0;
  const double share = 1.0 / (standing.end - standing.begin);
  for (int t = standing.begin; t < standing.end; ++t) {
    standing.p += share * plan.sole[side].col(t);
    standing.turn += share * plan.turn[side][t];
  }
  standing.p.z() = 0.0;
}

// Moves a place by no more than it takes for the leg to reach it in every frame of the stance, where that can be: a
// step that is long on one side of the hip only needs no shorter stance.
void draw_within_reach(const GroundPlan& plan, const LegPose& legs, int side, Standing& standing) {
  constexpr int kRounds = 20;
  for (int round = 0; round < kRounds; ++round) {
    double worst = 0.0;
    Eigen::Vector2d back = Eigen::Vector2d::Zero();
    for (int t = standing.begin; t < standing.end; ++t) {
      const Eigen::Vector2d step = step_of(plan, legs, side, t, standing.p, standing.turn);
      const double excess = step.norm() - longest_step(legs, side, plan.base(2, t));
      if (excess <= worst) continue;
      worst = excess;
      back = step * (excess / step.norm());
    }
    if (worst < kReachSlack) return;
    standing.p.head<2>() -= back;
  }
}

// Stances of a foot, each shortened to the frames in which the leg reaches it.
std::vector<Standing> find_standing(const GroundPlan& plan, const LegPose& legs, int side,
                                    const std::vector<char>& stands) {
  std::vector<Standing> all;
  const int frames = static_cast<int>(stands.size());
  for (int t = 0; t < frames; ++t) {
    if (stands[t] == 0) continue;
    if (t == 0 || stands[t - 1] == 0) all.push_back({t, t, Eigen::Vector3d::Zero(), 0.0});
    all.back().end = t + 1;
  }
  for (Standing& standing : all) {
    for (int trial = 0; trial < 4; ++trial) {
      place(plan, side, standing);
      draw_within_reach(plan, legs, side, standing);
      const auto reached = [&](int t) {
        return step_of(plan, legs, side, t, standing.p, standing.turn).norm() <=
               longest_step(legs, side, plan.base(2, t)) + kReachSlack;
      };
      const int before = standing.end - standing.begin;
      while (standing.end - standing.begin > 3 && !reached(standing.end - 1)) --standing.end;
      while (standing.end - standing.begin > 3 && !reached(standing.begin)) ++standing.begin;
      if (standing.end - standing.begin == before) break;
    }
  }
  return all;
}

double eased(double s) { return s * s * (3.0 - 2.0 * s); }

// Two stances with too little time for the step between them give up frames for it.
void make_time(double step_speed, std::vector<Standing>& all) {
  for (std::size_t i = 1; i < all.size(); ++i) {
    Standing& before = all[i - 1];
    Standing& after = all[i];
    const double step = (after.p - before.p).norm();
    const double wanted = kRate * std::max(kLeastStepTime, step / step_speed);
    while (after.begin - before.end < wanted) {
      const bool first = before.end - before.begin > 3, second = after.end - after.begin > 3;
      if (!first && !second) break;
      if (first) --before.end;
      if (second) ++after.begin;
    }
  }
}

// From one stance to the next the sole goes straight and eased, and as far out of that line as the person's foot does;
// where there is no stance before or after, as the person's foot does.
void swing(int begin, int end, const Standing* from, const Standing* to, Eigen::Matrix3Xd& sole,
           Eigen::VectorXd& turn) {
  const Eigen::Vector3d leave = sole.col(begin), land = sole.col(end - 1);
  const double turn_leave = turn[begin], turn_land = turn[end - 1];
  const Standing& first = from != nullptr ? *from : *to;
  const Standing& last = to != nullptr ? *to : *from;
  const double length = end - begin + 1;
  for (int t = begin; t < end; ++t) {
    const double linear = (t - begin + 1) / length;
    const double s = from == nullptr ? 1.0 : to == nullptr ? 0.0 : eased(linear);
    const int near = std::min(from == nullptr ? end : t - begin + 1, to == nullptr ? end : end - t);
    const double share = eased(std::min(1.0, near / kEase));
    const double lift = from != nullptr && to != nullptr ? std::pow(std::sin(std::numbers::pi * linear), 2) : 0.0;
    const Eigen::Vector3d aside = sole.col(t) - (1.0 - s) * leave - s * land;
    sole.col(t) = (1.0 - s) * first.p + s * last.p + share * aside;
    sole(2, t) = std::max({sole(2, t), kStepHeight * lift, 0.0});
    turn[t] = (1.0 - s) * first.turn + s * last.turn + share * (turn[t] - (1.0 - s) * turn_leave - s * turn_land);
  }
}

void place_soles(const LegPose& legs, const FootStance& person, double step_speed, GroundPlan& plan) {
  for (int side = 0; side < 2; ++side) {
    std::vector<Standing> all = find_standing(plan, legs, side, person.stands[side]);
    make_time(step_speed, all);
    std::vector<char>& stands = plan.stance.stands[side];
    const int frames = static_cast<int>(plan.yaw.size());
    stands.assign(frames, 0);
    int free = 0;
    for (std::size_t i = 0; i <= all.size() && !all.empty(); ++i) {
      const Standing* const from = i > 0 ? &all[i - 1] : nullptr;
      const Standing* const to = i < all.size() ? &all[i] : nullptr;
      const int next = to != nullptr ? to->begin : frames;
      if (free < next) swing(free, next, from, to, plan.sole[side], plan.turn[side]);
      if (to == nullptr) break;
      for (int t = to->begin; t < to->end; ++t) {
        plan.sole[side].col(t) = to->p;
        plan.turn[side][t] = to->turn;
        stands[t] = 1;
      }
      free = to->end;
    }
  }
}

// Lowers the base, slowly, to where both legs reach their standing soles.
void lower_base(const LegPose& legs, double sigma, GroundPlan& plan) {
  const auto frames = plan.yaw.size();
  Eigen::VectorXd drop = Eigen::VectorXd::Zero(frames);
  for (Eigen::Index t = 0; t < frames; ++t) {
    for (int side = 0; side < 2; ++side) {
      if (plan.stance.stands[side][t] == 0) continue;
      const double step =
          step_of(plan, legs, side, static_cast<int>(t), plan.sole[side].col(t), plan.turn[side][t]).norm();
      const double reach = kReach * legs.length(side);
      const double height = std::sqrt(std::max(reach * reach - step * step, 0.0)) + legs.ankle_height(side);
      drop[t] = std::max(drop[t], plan.base(2, t) + legs.hip(side).z() - height);
    }
  }
  const int reach = static_cast<int>(std::ceil(3.0 * sigma));
  Eigen::VectorXd widest(frames);
  for (Eigen::Index t = 0; t < frames; ++t) {
    const Eigen::Index begin = std::max<Eigen::Index>(t - reach, 0);
    widest[t] = drop.segment(begin, std::min<Eigen::Index>(t + reach + 1, frames) - begin).maxCoeff();
  }
  plan.base.row(2) -= smoothed(widest.transpose(), sigma);
}

// A sole that swings stays where its leg reaches it.
void reach_swings(const LegPose& legs, GroundPlan& plan) {
  for (int side = 0; side < 2; ++side) {
    for (int t = 0; t < static_cast<int>(plan.yaw.size()); ++t) {
      if (plan.stance.stands[side][t] != 0) continue;
      const Eigen::Vector3d hip = plan.base.col(t) + yaw_rotation(plan.yaw[t]) * legs.hip(side);
      const Eigen::Vector3d to_ankle =
          yaw_rotation(plan.turn[side][t]) * Eigen::Vector3d(legs.sole(side).x(), 0.0, 0.0) -
          Eigen::Vector3d(0.0, 0.0, legs.ankle_height(side));
      const Eigen::Vector3d span = plan.sole[side].col(t) - to_ankle - hip;
      const double most = kReach * legs.length(side);
      if (span.norm() > most) plan.sole[side].col(t) = hip + span * (most / span.norm()) + to_ankle;
    }
  }
}

// The person's stance; where a poor recording lets neither foot stand, under looser rules.
FootStance stance_of(const HumanMotion& source) {
  FootStance stance;
  for (const double looseness : {1.0, 2.0, 4.0}) {
    StanceRule rule;
    rule.place *= looseness;
    rule.drift *= looseness;
    stance = find_stance(source, rule);
    int neither = 0;
    for (int t = 0; t < source.frames(); ++t) neither += stance.stands[0][t] == 0 && stance.stands[1][t] == 0 ? 1 : 0;
    if (neither * 10 <= source.frames()) break;
  }
  return stance;
}

}  // namespace

GroundPlan plan_ground(const RobotModel& robot, const LegPose& legs, const HumanMotion& source, const PairTree& tree,
                       const PointTracks& reshaped, const GroundPlanOptions& options) {
  GroundPlan plan;
  const double sigma = options.smoothing * kRate;
  plan_base(robot, source, reshaped, sigma, plan);
  follow_feet(legs, tree, reshaped, sigma, plan);
  place_soles(legs, stance_of(source), options.step_speed, plan);
  lower_base(legs, sigma, plan);
  reach_swings(legs, plan);
  return plan;
}

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6X = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 12>;

constexpr int kSteps = 20;
constexpr double kTurnWeight = 0.1;   // [m/rad]: where both cannot be had, the place of the sole comes before its turn
constexpr double kDamping = 1e-8;     // of the squared Jacobian
constexpr double kBentReach = 0.985;  // of a straight leg, where the knee still has a slope
constexpr double kDone = 1e-6;        // [m]
constexpr double kLongestStep = 0.3;  // of a joint in one step [rad]

Eigen::Vector3d turn_to(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to) {
  const Eigen::AngleAxisd turn(to * from.transpose());
  return turn.angle() * turn.axis();
}

}  // namespace

struct LegPose::Walk {
  Eigen::Matrix3d R_WF;
  Eigen::Vector3d p_WF;
  std::vector<Eigen::Vector3d> axis, at;  // of each link of the path, W
};

LegPose::LegPose(const RobotModel& robot) : robot_(robot) {
  const std::vector<std::vector<int>> soles = soles_of_feet(robot);
  for (int side = 0; side < 2; ++side) {
    Leg& leg = legs_[side];
    leg.joints = robot.roles.legs[side];
    const int foot = robot.shapes[soles[side].front()].link;
    for (int link = foot; link > 0; link = robot.links[link].parent) leg.path.push_back(link);
    std::reverse(leg.path.begin(), leg.path.end());
    Walk walked;
    walk(leg, {}, Eigen::VectorXd::Zero(robot.dof()), walked);
    const Eigen::Matrix3d R_LB = walked.R_WF.transpose();
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const int shape : soles[side]) middle += robot.shapes[shape].X_LS.p / static_cast<double>(soles[side].size());
    leg.sole = {Eigen::Quaterniond(R_LB), middle - R_LB.col(2) * robot.shapes[soles[side].front()].radius};
    const std::size_t first = leg.path.size() - leg.joints.size();
    leg.hip = walked.at[first];
    leg.length = (walked.at.back() - leg.hip).norm();
    leg.ankle_height = -(leg.sole.R.conjugate() * leg.sole.p).z();
  }
}

void LegPose::walk(const Leg& leg, const Pose& X_WB, const Eigen::VectorXd& q, Walk& out) const {
  out.axis.resize(leg.path.size());
  out.at.resize(leg.path.size());
  Eigen::Matrix3d R = X_WB.R.toRotationMatrix();
  Eigen::Vector3d p = X_WB.p;
  for (std::size_t i = 0; i < leg.path.size(); ++i) {
    const RobotLink& link = robot_.links[leg.path[i]];
    p += R * link.X_PL.p;
    R = R * link.X_PL.R.toRotationMatrix() * Eigen::AngleAxisd(q[leg.path[i] - 1], link.axis);
    out.at[i] = p;
    out.axis[i] = R * link.axis;
  }
  out.R_WF = R;
  out.p_WF = p;
}

Pose LegPose::sole_pose(int side, const Pose& X_WB, const Eigen::VectorXd& q) const {
  Walk walked;
  walk(legs_[side], X_WB, q, walked);
  return Pose{Eigen::Quaterniond(walked.R_WF), walked.p_WF} * legs_[side].sole;
}

Pose LegPose::within_reach(int side, const Pose& X_WB, const Pose& X_WS) const {
  const Leg& leg = legs_[side];
  const Eigen::Vector3d hip = X_WB * leg.hip;
  const Eigen::Vector3d span = X_WS * leg.sole.inverse().p - hip;
  const double most = kBentReach * leg.length;
  if (span.norm() <= most) return X_WS;
  return {X_WS.R, X_WS.p + span * (most / span.norm() - 1.0)};
}

double LegPose::solve(int side, const Pose& X_WB, const Pose& X_WS, Eigen::VectorXd& q) const {
  const Leg& leg = legs_[side];
  const Pose X_WF = X_WS * leg.sole.inverse();
  const Eigen::Matrix3d target = X_WF.R.toRotationMatrix();
  const auto joints = static_cast<Eigen::Index>(leg.joints.size());
  const std::size_t first = leg.path.size() - leg.joints.size();
  Walk walked;
  Matrix6X J(6, joints);
  double miss = 0.0;
  for (int step = 0; step <= kSteps; ++step) {
    walk(leg, X_WB, q, walked);
    Vector6 error;
    error << X_WF.p - walked.p_WF, kTurnWeight * turn_to(walked.R_WF, target);
    miss = error.head<3>().norm();
    if (step == kSteps || error.norm() < kDone) break;
    for (Eigen::Index k = 0; k < joints; ++k) {
      const Eigen::Vector3d& axis = walked.axis[first + k];
      J.col(k) << axis.cross(walked.p_WF - walked.at[first + k]), kTurnWeight * axis;
      const RobotJoint& joint = robot_.joints[leg.joints[k]];  // a joint at its limit does not share in the step
      const double angle = q[leg.joints[k]];
      const double wish = J.col(k).dot(error);
      if ((angle <= joint.lower && wish < 0.0) || (angle >= joint.upper && wish > 0.0)) J.col(k).setZero();
    }
    Eigen::Matrix<double, 6, 6> gram = J * J.transpose();
    gram.diagonal().array() += kDamping + 1e-2 * error.squaredNorm();
    const Eigen::VectorXd change = J.transpose() * gram.ldlt().solve(error);
    const double shrink = std::min(1.0, kLongestStep / std::max(change.cwiseAbs().maxCoeff(), 1e-12));
    for (Eigen::Index k = 0; k < joints; ++k) {
      const RobotJoint& joint = robot_.joints[leg.joints[k]];
      q[leg.joints[k]] = std::clamp(q[leg.joints[k]] + shrink * change[k], joint.lower, joint.upper);
    }
  }
  return miss;
}

}  // namespace duet
