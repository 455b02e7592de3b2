#include "duet/metrics/locomotion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/motion/human_motion.h"
#include "duet/robots/human_body.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

// A swing is from where the foot rises above 1.5 cm until it is below 1 cm again.
constexpr double kLifted = 0.015, kDownward = 0.01;

void add_speeds(const Recording& recording, std::map<std::string, double>& metrics) {
  const int first = static_cast<int>(std::lround(kWalkSettles * recording.rate_hz));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int t = first; t < recording.frames(); ++t) {
    const RobotState& state = recording.robot[t];
    const Eigen::Vector3d v_heading = yaw_rotation(-yaw_of(state.X_WB.R)) * state.v_WB;
    sum += Eigen::Vector3d(v_heading.x(), v_heading.y(), (state.X_WB.R * state.w_WB_B).z());
  }
  if (recording.frames() <= first) return;
  sum /= recording.frames() - first;
  metrics["speed_forward"] = sum.x();
  metrics["speed_sideways"] = sum.y();
  metrics["turn_rate"] = sum.z();
}

// The highest rise of one foot's link over where it stood at the start, swing by swing.
class SwingMeter {
 public:
  void add(double height) {
    if (height > kLifted) top_ = std::max(top_, height);
    if (height > kDownward || top_ == 0.0) return;
    sum_ += top_;
    ++swings_;
    top_ = 0.0;
  }
  [[nodiscard]] double sum() const { return sum_; }
  [[nodiscard]] int swings() const { return swings_; }

 private:
  double top_ = 0.0, sum_ = 0.0;
  int swings_ = 0;
};

void add_feet(const Recording& recording, const RobotModel& robot, std::map<std::string, double>& metrics) {
  const std::vector<std::vector<int>> soles = soles_of_feet(robot);
  if (soles.size() != 2 || recording.frames() == 0) return;
  const std::array<int, 2> links = {robot.shapes[soles[0].front()].link, robot.shapes[soles[1].front()].link};
  Kinematics kinematics(robot);
  std::array<SwingMeter, 2> swings;
  std::array<double, 2> stance{};
  double closest = std::numeric_limits<double>::infinity();
  for (int t = 0; t < recording.frames(); ++t) {
    kinematics.update(recording.robot[t].X_WB, recording.robot[t].q);
    for (int side = 0; side < 2; ++side) {
      const double height = kinematics.p_WL(links[side]).z();
      if (t == 0) stance[side] = height;
      swings[side].add(height - stance[side]);
    }
    closest = std::min(closest, (kinematics.p_WL(links[0]) - kinematics.p_WL(links[1])).head<2>().norm());
  }
  metrics["closest_feet"] = closest;
  const int count = swings[0].swings() + swings[1].swings();
  if (count > 0) metrics["swing_height"] = (swings[0].sum() + swings[1].sum()) / count;
}

void add_upper_body(const Recording& recording, const RobotModel& robot, std::map<std::string, double>& metrics) {
  const std::vector<int> legs = leg_joints(robot);
  double angle = 0.0, rate = 0.0;
  long count = 0;
  for (int t = 1; t + 1 < recording.frames(); ++t) {
    const RobotState& state = recording.robot[t];
    const Eigen::VectorXd& q = recording.reference[t].q;
    for (int joint = 0; joint < robot.dof(); ++joint) {
      if (std::ranges::binary_search(legs, joint)) continue;
      const double wanted =
          (recording.reference[t + 1].q[joint] - recording.reference[t - 1].q[joint]) * recording.rate_hz / 2.0;
      angle += std::abs(state.q[joint] - q[joint]);
      rate += std::abs(state.v[joint] - wanted);
      ++count;
    }
  }
  if (count == 0) return;
  metrics["upper_body_error"] = angle / static_cast<double>(count);
  metrics["upper_body_rate_error"] = rate / static_cast<double>(count);
}

}  // namespace

std::map<std::string, double> locomotion_metrics(const Recording& recording, const RobotModel& robot) {
  std::map<std::string, double> metrics;
  add_speeds(recording, metrics);
  add_feet(recording, robot, metrics);
  add_upper_body(recording, robot, metrics);
  if (recording.frames() > 0)
    metrics["drift"] = (recording.robot.back().X_WB.p - recording.robot.front().X_WB.p).head<2>().norm();
  return metrics;
}

namespace {

constexpr double kLimitSlack = 1e-9;  // [rad]
constexpr double kSpeedSlack = 1e-9;  // of the limit

using LineSegment = std::array<Eigen::Vector3d, 2>;

double value_at(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

double mean_of_values(const std::vector<double>& values) {
  if (values.empty()) return std::nan("");
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double distance(const LineSegment& a, const LineSegment& b) {
  const Eigen::Vector3d u = a[1] - a[0], v = b[1] - b[0], w = a[0] - b[0];
  const double uu = u.squaredNorm(), uv = u.dot(v), vv = v.squaredNorm(), uw = u.dot(w), vw = v.dot(w);
  const double det = uu * vv - uv * uv;
  double s = det > 1e-12 ? std::clamp((uv * vw - vv * uw) / det, 0.0, 1.0) : 0.0;
  const double t = vv > 1e-12 ? std::clamp((uv * s + vw) / vv, 0.0, 1.0) : 0.0;
  s = uu > 1e-12 ? std::clamp((uv * t - uw) / uu, 0.0, 1.0) : 0.0;
  return (w + s * u - t * v).norm();
}

bool is_arm(const std::string& region) { return region == "hand" || region == "forearm"; }

struct Rod {
  explicit Rod(const LineSegment& s) : ends(s), middle(0.5 * (s[0] + s[1])), half(0.5 * (s[1] - s[0]).norm()) {}
  LineSegment ends;
  Eigen::Vector3d middle;
  double half;
};

// Makes `deepest` the depth of two rods in each other, each with its radius, where that is deeper. Most are told
// apart by their middles alone.
void deepen(const Rod& a, const Rod& b, double radii, double& deepest) {
  const double near = radii - deepest + a.half + b.half;
  if (near < 0.0 || (a.middle - b.middle).squaredNorm() > near * near) return;
  deepest = std::max(deepest, radii - distance(a.ends, b.ends));
}

struct Samples {
  std::vector<double> height, skate, depth;
  double self_depth = 0.0;
};

class Sampler {
 public:
  Sampler(const PairedMotion& motion, const RobotModel& robot)
      : motion_(motion),
        robot_(robot),
        kinematics_(robot),
        body_(make_human_body(bone_lengths(motion.source_partner))),
        stance_(find_stance(motion.source_reactor)),
        soles_(soles_of_feet(robot)) {
    for (const RobotShape& shape : robot.shapes) robot_arms_.push_back(is_arm(shape.region));
    for (const HumanCapsule& capsule : body_.capsules) human_arms_.push_back(is_arm(capsule.region));
  }

  Samples sample() {
    Samples out;
    for (int t = 0; t < motion_.frames(); ++t) {
      kinematics_.update(motion_.robot.root[t], motion_.robot.q.col(t));
      stand(t, out);
      touch(t, out);
    }
    return out;
  }

 private:
  [[nodiscard]] Eigen::Vector3d sole_middle(int side) const {
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    for (const int shape : soles_[side])
      p += (kinematics_.shape_position(shape) - Eigen::Vector3d(0, 0, robot_.shapes[shape].radius)) /
           static_cast<double>(soles_[side].size());
    return p;
  }

  void stand(int t, Samples& out) {
    for (int side = 0; side < 2 && soles_.size() == 2; ++side) {
      const Eigen::Vector3d p = sole_middle(side);
      const bool stands = stance_.stands[side][t] != 0;
      if (stands) out.height.push_back(std::abs(p.z()));
      if (stands && t > 0 && stance_.stands[side][t - 1] != 0)
        out.skate.push_back((p - before_[side]).head<2>().norm() * motion_.robot.rate_hz);
      before_[side] = p;
    }
  }

  [[nodiscard]] LineSegment segment(int shape) const {
    const RobotShape& s = robot_.shapes[shape];
    const Eigen::Vector3d along = kinematics_.R_WL(s.link) * (s.X_LS.R * Eigen::Vector3d(0, 0, s.half_length));
    const Eigen::Vector3d p = kinematics_.shape_position(shape);
    return {p - along, p + along};
  }

  void touch(int t, Samples& out) {
    std::vector<Rod> segments;
    segments.reserve(robot_.shapes.size());
    for (int i = 0; i < static_cast<int>(robot_.shapes.size()); ++i) segments.emplace_back(segment(i));
    double deepest = 0.0;
    for (std::size_t c = 0; c < body_.capsules.size(); ++c) {
      const HumanCapsule& capsule = body_.capsules[c];
      const Rod bone(capsule.ends(motion_.partner.joints.frame(t)));
      for (std::size_t i = 0; i < segments.size(); ++i)
        if (!human_arms_[c] || !robot_arms_[i])
          deepen(segments[i], bone, capsule.radius + robot_.shapes[i].radius, deepest);
    }
    out.depth.push_back(deepest);
    for (const auto& [a, b] : robot_.self_collision)
      deepen(segments[a], segments[b], robot_.shapes[a].radius + robot_.shapes[b].radius, out.self_depth);
  }

  const PairedMotion& motion_;
  const RobotModel& robot_;
  Kinematics kinematics_;
  HumanBody body_;
  std::vector<bool> robot_arms_, human_arms_;  // of shapes and capsules
  FootStance stance_;
  std::vector<std::vector<int>> soles_;
  std::array<Eigen::Vector3d, 2> before_ = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
};

double bone_change(const PairedMotion& motion) {
  double most = 0.0;
  for (int t = 0; t < motion.frames(); ++t) {
    for (int joint = kLeftShoulder; joint <= kRightHand; ++joint) {
      const auto length = [&](const HumanMotion& m) {
        return (m.joints.at(t, joint) - m.joints.at(t, kSmplParents[joint])).norm();
      };
      most = std::max(most, std::abs(length(motion.partner) - length(motion.source_partner)));
    }
  }
  return most;
}

void add_joint_figures(const RobotMotion& motion, const RobotModel& robot, std::map<std::string, double>& out) {
  const Eigen::MatrixXd& q = motion.q;
  const Eigen::Index frames = q.cols();
  const Eigen::MatrixXd v = (q.rightCols(frames - 1) - q.leftCols(frames - 1)) * motion.rate_hz;
  out["joint_speed_max"] = v.cwiseAbs().maxCoeff();
  out["joint_acceleration_max"] =
      frames < 3 ? std::nan("")
                 : (v.rightCols(frames - 2) - v.leftCols(frames - 2)).cwiseAbs().maxCoeff() * motion.rate_hz;
  double violations = 0.0;
  for (Eigen::Index j = 0; j < q.rows(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    violations += static_cast<double>(
        ((q.row(j).array() < joint.lower - kLimitSlack) || (q.row(j).array() > joint.upper + kLimitSlack)).count());
  }
  out["limit_violations"] = violations;
  double quick = 0.0;
  for (Eigen::Index j = 0; j < q.rows(); ++j) {
    const double most = robot.joints[static_cast<std::size_t>(j)].velocity;
    if (most > 0.0) quick += static_cast<double>((v.row(j).array().abs() > most * (1.0 + kSpeedSlack)).count());
  }
  out["speed_violations"] = quick;
}

void add_lean(const RobotMotion& motion, std::map<std::string, double>& out) {
  double roll = 0.0, tilt = 0.0;
  for (const Pose& X_WB : motion.root) {
    const Eigen::Matrix3d R = X_WB.R.toRotationMatrix();
    roll = std::max(roll, std::abs(std::asin(std::clamp(R(2, 1), -1.0, 1.0))));  // of the y axis out of the horizontal
    tilt = std::max(tilt, std::acos(std::clamp(R(2, 2), -1.0, 1.0)));
  }
  out["root_roll_max"] = roll;
  out["root_tilt_max"] = tilt;
}

}  // namespace

std::map<std::string, double> grounding_metrics(const PairedMotion& motion, const RobotModel& robot) {
  require(motion.robot.q.rows() == robot.dof() && motion.frames() >= 2,
          "grounding metrics: expected a motion of this robot with at least two frames");
  const Samples samples = Sampler(motion, robot).sample();
  std::map<std::string, double> out;
  out["sole_height"] = value_at(samples.height, 0.5);
  out["sole_height_max"] = value_at(samples.height, 1.0);
  out["foot_skate"] = mean_of_values(samples.skate);
  out["foot_skate_max"] = value_at(samples.skate, 0.99);
  out["penetration"] = mean_of_values(samples.depth);
  out["penetration_max"] = value_at(samples.depth, 1.0);
  out["self_penetration_max"] = samples.self_depth;
  out["bone_change_max"] = bone_change(motion);
  add_joint_figures(motion.robot, robot, out);
  add_lean(motion.robot, out);
  return out;
}

}  // namespace duet
