#include "duet/hardware/guard/identification.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "duet/core/require.h"
#include "duet/hardware/safety/foot_load.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

constexpr long kLeastStates = 500;
constexpr double kMostMoved = 0.15;    // of a joint while it stands [rad]
constexpr double kLeastCarried = 0.5;  // share of the card's mass
constexpr double kLoad = 0.5;          // from which a difference is said to lie somewhere [kg]
constexpr double kDegree = std::numbers::pi / 180.0;

struct Sole {
  Eigen::Vector3d normal, middle;  // W
};

// The plane of the points, which are of spheres of one size.
Sole plane_of(const std::vector<Eigen::Vector3d>& points) {
  Sole sole{Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero()};
  for (const Eigen::Vector3d& p : points) sole.middle += p / static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) scatter += (p - sole.middle) * (p - sole.middle).transpose();
  sole.normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors().col(0);
  if (sole.normal.z() < 0.0) sole.normal = -sole.normal;
  return sole;
}

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

StandingIdentification::StandingIdentification(std::shared_ptr<const RobotModel> robot) : robot_(std::move(robot)) {
  require(robot_ != nullptr, "identification: expected a robot, found none");
  (void)FootLoad(robot_);
  q_.setZero(robot_->dof());
  tau_ = q_;
}

void StandingIdentification::see(const RobotReading& reading) {
  const Eigen::VectorXd& q = reading.state.q;
  least_q_ = states_ == 0 ? q : least_q_.cwiseMin(q).eval();
  most_q_ = states_ == 0 ? q : most_q_.cwiseMax(q).eval();
  q_ += q;
  tau_ += reading.tau;
  up_B_ += reading.state.X_WB.R.conjugate() * Eigen::Vector3d::UnitZ();
  ++states_;
}

StandingFindings StandingIdentification::findings() const {
  if (states_ < kLeastStates)
    throw std::runtime_error(
        fmt::format("identification: expected {} states at least, found {}", kLeastStates, states_));
  int moved = 0;
  const double most = (most_q_ - least_q_).maxCoeff(&moved);
  if (most > kMostMoved)
    throw std::runtime_error(
        fmt::format("identification: expected a robot that stands still, found {} that moved by {:.2f} rad",
                    robot_->joints[moved].name, most));
  const double share = 1.0 / static_cast<double>(states_);
  RobotState state = robot_->standing_state();
  state.X_WB = {Eigen::Quaterniond::FromTwoVectors(up_B_, Eigen::Vector3d::UnitZ()), Eigen::Vector3d::Zero()};
  state.q = share * q_;
  const Eigen::VectorXd tau = share * tau_;
  Eigen::VectorXd weight(6 + robot_->dof());
  bias_forces(*robot_, state, weight);
  Kinematics kinematics(*robot_);
  kinematics.update(state.X_WB, state.q);

  StandingFindings found{.states = states_};
  const std::vector<std::vector<int>> soles = soles_of_feet(*robot_);
  FootLoad::Wrench floor = FootLoad::Wrench::Zero();
  const auto wrenches = FootLoad(robot_).wrenches(state.X_WB, state.q, weight, tau);
  std::array<Sole, 2> feet;
  std::vector<Eigen::Vector3d> all;
  for (std::size_t side = 0; side < 2; ++side) {
    std::vector<Eigen::Vector3d> points;
    for (const int shape : soles[side]) points.push_back(kinematics.shape_position(shape));
    all.insert(all.end(), points.begin(), points.end());
    feet[side] = plane_of(points);
    if (!wrenches[side])
      throw std::runtime_error("identification: expected legs with bent knees, found a straight one");
    floor += *wrenches[side];
  }
  found.card_mass = robot_->total_mass();
  found.mass = floor.z() / kGravity;
  if (found.mass < kLeastCarried * found.card_mass)
    throw std::runtime_error(
        fmt::format("identification: expected legs that carry the robot's {:.1f} kg, found {:.1f} kg", found.card_mass,
                    found.mass));
  const Eigen::Vector3d moment_of_card = state.X_WB.R * Eigen::Vector3d(weight.segment<3>(3));
  const auto place = [](const Eigen::Vector3d& moment, double mass) {
    return Eigen::Vector2d(Eigen::Vector2d(-moment.y(), moment.x()) / (mass * kGravity));
  };
  found.com = place(floor.tail<3>(), found.mass) - place(moment_of_card, found.card_mass);
  const auto lean_over = [](const Eigen::Vector3d& up) {
    return Eigen::Vector2d(Eigen::Vector3d::UnitZ().cross(up.normalized()).head<2>());
  };
  found.lean = lean_over(plane_of(all).normal);
  found.lean_by_force = lean_over(floor.head<3>());
  found.soles_apart = angle_between(feet[0].normal, feet[1].normal);
  found.soles_height = (feet[0].middle - feet[1].middle).dot(plane_of(all).normal);
  for (const std::vector<int>& arm : robot_->roles.arms)
    for (const int joint : arm) {
      const double beyond = std::abs(tau[joint] - weight[6 + joint]);
      if (beyond <= found.arm_torque) continue;
      found.arm_torque = beyond;
      found.arm_joint = joint;
    }
  return found;
}

std::string findings_text(const StandingFindings& f, const RobotModel& robot) {
  const double more = f.mass - f.card_mass;
  std::string load;
  if (std::abs(more) > kLoad) {
    const Eigen::Vector2d at = f.com * f.mass / more;
    load = fmt::format(", {:.2f} m ahead of and {:.2f} m left of the card's centre of mass", at.x(), at.y());
  }
  const Eigen::Vector2d lean = f.lean / kDegree, by_force = f.lean_by_force / kDegree;
  return fmt::format(
      "standing, {} states, beside the card of '{}':\n"
      "  mass {:.2f} kg by the legs' torques, the card's {:.2f}: {:+.2f} kg{}\n"
      "  centre of mass {:+.3f} m ahead and {:+.3f} m left of the card's\n"
      "  IMU: leans by {:.2f} degrees over the floor (roll {:+.2f}, pitch {:+.2f}); over what the legs carry by {:.2f} "
      "(roll {:+.2f}, pitch {:+.2f})\n"
      "  soles: {:.2f} degrees and {:.1f} mm apart: zeros of the legs' joints, or a foot that is not flat\n"
      "  arms: at most {:.2f} N m beyond the model's ({})\n"
      "not to be told apart: an IMU that leans and a floor that slopes, but by the torques, which friction falsifies "
      "by "
      "degrees (turn the robot round on its place: the IMU's lean turns with it, the floor's does not); a load and a "
      "factor or friction in the legs' torques; the zeros of one leg's joints; a zero that both legs have and a lean; "
      "the "
      "height of a load",
      f.states, robot.name, f.mass, f.card_mass, more, load, f.com.x(), f.com.y(), lean.norm(), lean.x(), lean.y(),
      by_force.norm(), by_force.x(), by_force.y(), f.soles_apart / kDegree, 1e3 * f.soles_height, f.arm_torque,
      f.arm_joint < 0 ? "none" : robot.joints[f.arm_joint].name);
}

nlohmann::json findings_json(const StandingFindings& f, const RobotModel& robot) {
  const auto pair = [](const Eigen::Vector2d& v) { return nlohmann::json{v.x(), v.y()}; };
  return {{"states", f.states},           {"mass", f.mass},
          {"card_mass", f.card_mass},     {"com", pair(f.com)},
          {"lean", pair(f.lean)},         {"lean_by_force", pair(f.lean_by_force)},
          {"soles_apart", f.soles_apart}, {"soles_height", f.soles_height},
          {"arm_torque", f.arm_torque},   {"arm_joint", f.arm_joint < 0 ? "" : robot.joints[f.arm_joint].name}};
}

}  // namespace duet
