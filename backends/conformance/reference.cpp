#include "duet/backends/conformance/reference.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

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

}  // namespace duet::conformance
