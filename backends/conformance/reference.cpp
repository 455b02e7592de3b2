#include "duet/backends/conformance/reference.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

#include "duet/robots/roles.h"

namespace duet::conformance {
namespace {

struct Rate {
  Eigen::Vector3d p;
  Eigen::Vector4d R;  // of the coefficients x, y, z, w
  Eigen::VectorXd q, a;
};

Rate rate_of(Dynamics& dynamics, const RobotState& state, const Eigen::VectorXd& Q) {
  const Eigen::Quaterniond spin(0.0, state.w_WB_B.x(), state.w_WB_B.y(), state.w_WB_B.z());
  return {state.v_WB, 0.5 * (state.X_WB.R * spin).coeffs(), state.v, acceleration(dynamics, state, Q)};
}

RobotState moved(const RobotState& state, const Rate& rate, double dt) {
  RobotState next = state;
  next.X_WB.p += dt * rate.p;
  next.X_WB.R.coeffs() += dt * rate.R;
  next.X_WB.R.normalize();
  next.q += dt * rate.q;
  next.v_WB += dt * rate.a.head<3>();
  next.w_WB_B += dt * rate.a.segment<3>(3);
  next.v += dt * rate.a.tail(state.v.size());
  return next;
}

Rate mean_of(const Rate& a, const Rate& b, const Rate& c, const Rate& d) {
  return {(a.p + 2.0 * b.p + 2.0 * c.p + d.p) / 6.0, (a.R + 2.0 * b.R + 2.0 * c.R + d.R) / 6.0,
          (a.q + 2.0 * b.q + 2.0 * c.q + d.q) / 6.0, (a.a + 2.0 * b.a + 2.0 * c.a + d.a) / 6.0};
}

struct LinkMotion {
  Eigen::Vector3d com, v, w;  // W
  Eigen::Matrix3d inertia;    // about the centre of mass, W
};

// Motion of each link, from the base outwards.
std::vector<LinkMotion> link_motions(const RobotModel& robot, const RobotState& state) {
  Kinematics kinematics(robot);
  kinematics.update(state.X_WB, state.q);
  std::vector<LinkMotion> motions(robot.links.size());
  std::vector<Eigen::Vector3d> v_origin(robot.links.size());
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const int link = static_cast<int>(i), parent = robot.links[i].parent;
    const Eigen::Matrix3d& R = kinematics.R_WL(link);
    if (i == 0) {
      motions[i].w = R * state.w_WB_B;
      v_origin[i] = state.v_WB;
    } else {
      motions[i].w = motions[parent].w + R * robot.links[i].axis * state.v[link - 1];
      v_origin[i] = v_origin[parent] + motions[parent].w.cross(kinematics.p_WL(link) - kinematics.p_WL(parent));
    }
    const Eigen::Vector3d c = R * robot.links[i].com;
    motions[i].com = kinematics.p_WL(link) + c;
    motions[i].v = v_origin[i] + motions[i].w.cross(c);
    motions[i].inertia = R * robot.links[i].inertia * R.transpose();
  }
  return motions;
}

}  // namespace

RobotState random_state(const RobotModel& robot, const Eigen::Vector3d& p_WB, double share, double speed,
                        Random& random) {
  const auto direction = [&random] { return Eigen::Vector3d(random.normal(), random.normal(), random.normal()); };
  RobotState state;
  state.X_WB.p = p_WB;
  state.X_WB.R = Eigen::AngleAxisd(random.uniform(0.0, 3.0), direction().normalized());
  state.v_WB = speed * direction();
  state.w_WB_B = speed * direction();
  state.q.resize(robot.dof());
  state.v.resize(robot.dof());
  for (int j = 0; j < robot.dof(); ++j) {
    const RobotJoint& joint = robot.joints[j];
    state.q[j] =
        0.5 * (joint.lower + joint.upper) + 0.5 * share * (joint.upper - joint.lower) * random.uniform(-1.0, 1.0);
    state.v[j] = speed * random.normal();
  }
  return state;
}

Eigen::VectorXd acceleration(Dynamics& dynamics, const RobotState& state, const Eigen::VectorXd& Q) {
  const RobotModel& robot = dynamics.kinematics().model();
  dynamics.update(state);
  Eigen::MatrixXd mass = dynamics.mass();
  for (int j = 0; j < robot.dof(); ++j) mass(6 + j, 6 + j) += robot.joints[j].armature;
  return mass.llt().solve(Q - dynamics.bias());
}

RobotState integrate(const RobotModel& robot, const Eigen::Vector3d& gravity_W, const RobotState& start,
                     const Eigen::VectorXd& Q, double seconds, double dt) {
  Dynamics dynamics(robot, gravity_W);
  RobotState state = start;
  const long steps = std::lround(seconds / dt);
  for (long i = 0; i < steps; ++i) {
    const Rate a = rate_of(dynamics, state, Q);
    const Rate b = rate_of(dynamics, moved(state, a, 0.5 * dt), Q);
    const Rate c = rate_of(dynamics, moved(state, b, 0.5 * dt), Q);
    const Rate d = rate_of(dynamics, moved(state, c, dt), Q);
    state = moved(state, mean_of(a, b, c, d), dt);
  }
  return state;
}

Momentum momentum_of(const RobotModel& robot, const RobotState& state) {
  const std::vector<LinkMotion> motions = link_motions(robot, state);
  Momentum momentum;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < motions.size(); ++i) {
    momentum.linear += robot.links[i].mass * motions[i].v;
    center += robot.links[i].mass * motions[i].com;
  }
  center /= robot.total_mass();
  for (std::size_t i = 0; i < motions.size(); ++i)
    momentum.angular +=
        motions[i].inertia * motions[i].w + robot.links[i].mass * (motions[i].com - center).cross(motions[i].v);
  return momentum;
}

double energy_above_base(const RobotModel& robot, const RobotState& state, double gravity) {
  const std::vector<LinkMotion> motions = link_motions(robot, state);
  double energy = 0.0;
  for (std::size_t i = 1; i < motions.size(); ++i) {
    const LinkMotion& motion = motions[i];
    const double mass = robot.links[i].mass;
    energy += 0.5 * mass * motion.v.squaredNorm() + 0.5 * motion.w.dot(motion.inertia * motion.w) +
              mass * gravity * (motion.com.z() - state.X_WB.p.z());
  }
  return energy;
}

double largest_joint_error(const RobotState& a, const RobotState& b) { return (a.q - b.q).cwiseAbs().maxCoeff(); }

namespace {

RobotLink solid(const std::string& name, double mass, const Eigen::Vector3d& moments) {
  RobotLink link;
  link.name = name;
  link.mass = mass;
  link.inertia = moments.asDiagonal();
  return link;
}

RobotShape sphere(const Eigen::Vector3d& p_L, double radius) {
  RobotShape shape;
  shape.X_LS.p = p_L;
  shape.radius = radius;
  shape.region = "foot";
  return shape;
}

RobotShape rod_shape(int link, double radius, double half_length) {
  RobotShape shape;
  shape.kind = ShapeKind::kCapsule;
  shape.link = link;
  shape.radius = radius;
  shape.half_length = half_length;
  return shape;
}

RobotLink heavy_base() { return solid("base", kBaseMass, Eigen::Vector3d::Constant(kBaseMass)); }

RobotJoint hinge(const std::string& name, double limit, double effort, double armature) {
  RobotJoint joint;
  joint.name = name;
  joint.lower = -limit;
  joint.upper = limit;
  joint.effort = effort;
  joint.velocity = 100.0;
  joint.armature = armature;
  return joint;
}

std::shared_ptr<const RobotModel> finished(RobotModel robot, const std::string& name) {
  robot.name = name;
  robot.neutral = Eigen::VectorXd::Zero(robot.dof());
  return std::make_shared<const RobotModel>(std::move(robot));
}

}  // namespace

std::shared_ptr<const RobotModel> tumbling_box() {
  RobotModel robot;
  robot.links = {solid("box", 10.0,
                       {10.0 * (0.4 * 0.4 + 0.9 * 0.9) / 12.0, 10.0 * (0.1 * 0.1 + 0.9 * 0.9) / 12.0,
                        10.0 * (0.1 * 0.1 + 0.4 * 0.4) / 12.0})};
  return finished(robot, "box");
}

std::shared_ptr<const RobotModel> sledge() {
  RobotModel robot;
  robot.links = {solid("sledge", 10.0, {0.4, 0.5, 0.6})};
  for (const double x : {-0.2, 0.2})
    for (const double y : {-kSledgeHalfWidth, kSledgeHalfWidth}) {
      robot.feet.push_back(static_cast<int>(robot.shapes.size()));
      robot.shapes.push_back(sphere({x, y, 0.02 - kSledgeHeight}, 0.02));
    }
  return finished(robot, "sledge");
}

std::shared_ptr<const RobotModel> ball(double mass, double radius) {
  RobotModel robot;
  robot.links = {solid("ball", mass, Eigen::Vector3d::Constant(0.4 * mass * radius * radius))};
  robot.shapes = {sphere(Eigen::Vector3d::Zero(), radius)};
  robot.feet = {0};
  return finished(robot, "ball");
}

std::shared_ptr<const RobotModel> wheel() {
  RobotModel robot;
  RobotLink rim = solid("rim", 2.0, {0.03, 0.03, kWheelInertia});
  rim.parent = 0;
  robot.links = {heavy_base(), rim};
  robot.joints = {hinge("axle", 1.0, kWheelEffort, kWheelArmature)};
  return finished(robot, "wheel");
}

std::shared_ptr<const RobotModel> held_hand() {
  RobotModel robot;
  RobotLink arm = solid("arm", 2.0, {0.01, 0.02, 0.02});
  arm.parent = 0;
  arm.com = {kReach, 0.0, 0.0};
  robot.links = {heavy_base(), arm};
  robot.joints = {hinge("shoulder", 1.0, 100.0, 0.0)};
  robot.shapes = {sphere({kReach, 0.0, 0.0}, kReachRadius)};
  robot.shapes[0].link = 1;
  robot.shapes[0].region = "hand";
  return finished(robot, "hand");
}

std::shared_ptr<const RobotModel> forearm_on_thigh() {
  RobotModel robot;
  RobotLink thigh = solid("thigh", 5.0, {kThighInertia, kThighInertia, kThighInertia});
  RobotLink forearm = solid("forearm", 1.0, {0.01, 0.002, 0.01});
  thigh.parent = forearm.parent = 0;
  forearm.X_PL.p = {kThighRadius + kForearmRadius, -kForearm, 0.0};
  forearm.com = {0.0, kForearm, 0.0};
  robot.links = {heavy_base(), thigh, forearm};
  robot.joints = {hinge("hip", 3.0, 100.0, 0.0), hinge("elbow", 1.0, 100.0, 0.0)};
  RobotShape on_thigh = rod_shape(1, kThighRadius, 0.2), on_forearm = rod_shape(2, kForearmRadius, 0.1);
  on_forearm.X_LS = {Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitY()),
                     forearm.com};
  on_thigh.region = "thigh";
  on_forearm.region = "forearm";
  robot.shapes = {on_thigh, on_forearm};
  robot.self_collision = {{0, 1}};
  return finished(robot, "limbs");
}

std::shared_ptr<const RobotModel> rods(int links) {
  RobotModel robot;
  robot.links = {heavy_base()};
  for (int i = 0; i < links; ++i) {
    RobotLink rod = solid("rod" + std::to_string(i), kRodMass, {kRodInertia, kRodInertia, 0.1 * kRodInertia});
    rod.parent = i;
    rod.axis = Eigen::Vector3d::UnitY();
    rod.com = {0.0, 0.0, -0.5 * kRodLength};
    if (i > 0) rod.X_PL.p = {0.0, 0.0, -kRodLength};
    robot.links.push_back(rod);
    robot.joints.push_back(hinge("hinge" + std::to_string(i), 3.1, 100.0, 0.0));
  }
  return finished(robot, "rods");
}

std::shared_ptr<const RobotModel> without_stops(const RobotModel& robot) {
  RobotModel copy = robot;
  for (RobotJoint& joint : copy.joints) {
    joint.lower = -10.0;
    joint.upper = 10.0;
  }
  return std::make_shared<const RobotModel>(std::move(copy));
}

RobotState state_at(const RobotModel& robot, const Eigen::Vector3d& p_WB) {
  RobotState state;
  state.X_WB.p = p_WB;
  state.q = robot.neutral;
  state.v = Eigen::VectorXd::Zero(robot.dof());
  return state;
}

JointCommand no_torque(const RobotModel& robot) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(robot.dof());
  return {zero, zero, zero, zero};
}

void hold_base(Backend& backend) {
  backend.push(0, -backend.scene().robot->links[0].mass * backend.scene().gravity, backend.state().X_WB.p);
}

namespace {

constexpr double kPendulumHeight = 0.65;              // of the centre of mass over the ankles [m]
constexpr double kPosition = 1.5, kSpeed = 0.35;      // ankle angle per angle of the pendulum [1], [s]
constexpr double kStiffness = 150.0, kDamping = 4.0;  // of the ankles; the card's 40 N m/rad do not hold the crouch
constexpr double kMostPitch = 0.3, kMostRoll = 0.2;   // [rad]

}  // namespace

AnkleBalance::AnkleBalance(const RobotModel& robot)
    : robot_(&robot), kinematics_(robot), jacobian_(Eigen::MatrixXd::Zero(3, 6 + robot.dof())) {
  for (const std::vector<int>& leg : robot.roles.legs)
    for (const int ankle : {leg[leg.size() - 2], leg.back()}) (is_roll(robot, ankle) ? roll_ : pitch_).push_back(ankle);
}

JointCommand AnkleBalance::command(const RobotState& state, const Eigen::VectorXd& q) {
  kinematics_.update(state.X_WB, state.q);
  Eigen::Vector3d feet = Eigen::Vector3d::Zero();
  for (const int foot : robot_->feet)
    feet += kinematics_.shape_position(foot) / static_cast<double>(robot_->feet.size());
  kinematics_.center_of_mass_jacobian(jacobian_);
  Eigen::VectorXd v(6 + robot_->dof());
  v << state.v_WB, state.w_WB_B, state.v;
  const Eigen::Vector3d lean = (kinematics_.center_of_mass() - feet) / kPendulumHeight;
  const Eigen::Vector3d rate = jacobian_ * v / kPendulumHeight;
  JointCommand command = robot_->default_command(q);
  for (const std::vector<int>& ankles : {pitch_, roll_})
    for (const int joint : ankles) {
      command.kp[joint] = kStiffness;
      command.kd[joint] = kDamping;
    }
  for (const int joint : pitch_)
    command.q_target[joint] += std::clamp(kPosition * lean.x() + kSpeed * rate.x(), -kMostPitch, kMostPitch);
  for (const int joint : roll_)
    command.q_target[joint] -= std::clamp(0.5 * (kPosition * lean.y() + kSpeed * rate.y()), -kMostRoll, kMostRoll);
  return command;
}

}  // namespace duet::conformance
