// Each tick: (1) the motion of all joints follows from the base's acceleration a_B when the soles stay where they are
// and the upper body follows its gains, a = T a_B + t; (2) the base rows of M a + h = J^T f then give what the contact
// forces f do to the centre of mass and the pelvis, y = G f + g; (3) f comes as near to the wanted y as friction and
// the edges of the soles allow; (4) torques of the legs are M a + h - J^T f. Between ticks the legs are held by weak
// gains around their predicted motion, so that what the model does not know does not grow for 20 ms.
#include "duet/controllers/vmc.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "duet/controllers/stance.h"
#include "duet/core/robot_state.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

// Found by hand on a G1 that follows clips and is pushed (tests/controllers/vmc_test.cpp). Nobody has swept them.
constexpr int kIterations = 120;          // of the contact forces
constexpr double kRegularisation = 1e-6;  // of contact forces: of two that do the same, the even one
constexpr double kSoleDamping = 10.0;     // of a sole that moves although it should not [1/s]
constexpr double kSingular = 1e-4;        // damping of a straight leg's Jacobian
constexpr double kStopMargin = 0.02;      // of the upper body's targets to their stops [rad]
constexpr double kYawRange = 0.3;         // of the pelvis against the feet [rad]
constexpr double kTiltRange = 0.3;        // largest error that is acted on [rad]
constexpr double kLeanRange = 0.05;       // of the centre of mass against a steady push [m]

using Matrix6 = Matrix6d;

class Vmc final : public Controller {
 public:
  Vmc(std::shared_ptr<const RobotModel> robot, const VmcOptions& options)
      : robot_(std::move(robot)),
        options_(options),
        kinematics_(*robot_),
        dynamics_(*robot_),
        stance_(*robot_),
        card_(robot_->default_command(robot_->neutral)),
        lower_(robot_->lower()),
        upper_(robot_->upper()),
        weight_(kGravity * robot_->total_mass()),
        shift_range_(robot_->stance_size().shift),
        forces_(stance_.points(), options.friction, kRegularisation, kIterations) {
    const int n = 6 + robot_->dof(), p = stance_.points(), u = static_cast<int>(stance_.upper().size());
    for (Eigen::VectorXd* vector : {&velocity_, &bias_, &t_, &a_, &effort_}) *vector = Eigen::VectorXd::Zero(n);
    mass_.setZero(n, n);
    T_.setZero(n, 6);
    J_.setZero(3 * p, n);
    J_com_.setZero(3, n);
    J_sole_.setZero(6, n);
    points_.setZero(3, p);
    G_.setZero(6, 3 * p);
    A_.setZero(6, 3 * p);
    f_rest_.setZero(3 * p);
    for (int i = 0; i < p; ++i) f_rest_[3 * i + 2] = weight_ / p;
    upper_mass_.setZero(u, u);
    upper_pull_.setZero(u);
    upper_solver_ = Eigen::LLT<Eigen::MatrixXd>(u);
    reset(robot_->standing_state());
  }

  [[nodiscard]] std::string_view name() const override { return "vmc"; }

  void reset(const RobotState& state) override {
    kinematics_.update(state.X_WB, state.q);
    stance_.points_of(kinematics_, points_);
    center_ = points_.rowwise().mean();
    stance_yaw_ = yaw_of(state.X_WB.R);
    root_rest_ = state.X_WB.p.head<2>() - kinematics_.center_of_mass().head<2>() + center_.head<2>();
    lean_.setZero();
    push_.setZero();
    first_tick_ = true;
    forces_.restart(f_rest_);
  }

  void act(const RobotState& state, const Reference& reference, JointCommand& command) override {
    observe(state);
    feel_push();
    move_upper(state, reference);
    keep_soles();
    shift_ = shift(reference);
    const Vector6d wanted = wanted_motion(state, reference);
    const Eigen::VectorXd& f = plan_forces(state, wanted);
    lean_against(f);
    effort_.noalias() = mass_ * a_;
    effort_ += bias_;
    effort_.noalias() -= J_.transpose() * f;
    fill(state, reference, command);
  }

 private:
  void observe(const RobotState& state) {
    kinematics_.update(state.X_WB, state.q);
    velocity_.head<3>() = state.v_WB;
    velocity_.segment<3>(3) = state.w_WB_B;
    velocity_.tail(robot_->dof()) = state.v;
    dynamics_.bias_forces(state, bias_);
    dynamics_.mass_matrix(state, mass_);
    kinematics_.center_of_mass_jacobian(J_com_);
    stance_.points_of(kinematics_, points_);
    stance_.jacobian_of(kinematics_, points_, J_);
    center_ = points_.rowwise().mean();
  }

  // The part of the momentum's change over the last tick that the planned forces do not explain is a push from outside.
  void feel_push() {
    const Eigen::Vector2d momentum = weight_ / kGravity * (J_com_.topRows<2>() * velocity_);
    if (!first_tick_) {
      const Eigen::Vector2d felt = (momentum - momentum_) / kTick - planned_;
      push_ += options_.push_gain * (felt - push_);
      push_ *= std::min(1.0, options_.push_range / std::max(push_.norm(), 1e-9));
    }
    momentum_ = momentum;
    first_tick_ = false;
  }

  // Mean acceleration of the upper body over the tick under the card's gains, taken linearly implicitly:
  // (M + dt kd + dt^2 kp) a = kp (q_ref - q - dt v) - kd v.
  void move_upper(const RobotState& state, const Reference& reference) {
    t_.setZero();
    const std::vector<int>& joints = stance_.upper();
    const int u = static_cast<int>(joints.size());
    for (int i = 0; i < u; ++i) {
      const int joint = joints[i];
      for (int k = 0; k < u; ++k) upper_mass_(i, k) = mass_(6 + joint, 6 + joints[k]);
      const double kp = card_.kp[joint], kd = card_.kd[joint];
      upper_mass_(i, i) += kTick * kd + kTick * kTick * kp;
      upper_pull_[i] =
          kp * (upper_target(reference, joint) - state.q[joint] - kTick * state.v[joint]) - kd * state.v[joint];
    }
    upper_solver_.compute(upper_mass_);
    upper_solver_.solveInPlace(upper_pull_);
    for (int i = 0; i < u; ++i) t_[6 + joints[i]] = upper_pull_[i];
  }

  // Legs move so that their soles do not: J_leg a_leg = -J_base a_B - damping of what they move all the same.
  void keep_soles() {
    T_.setZero();
    T_.topRows<6>().setIdentity();
    for (const Leg& leg : stance_.legs()) {
      kinematics_.point_jacobian(leg.link, kinematics_.p_WL(leg.link), J_sole_.topRows(3));
      kinematics_.angular_jacobian(leg.link, J_sole_.bottomRows(3));
      Matrix6 gram = kSingular * Matrix6::Identity();
      for (const int joint : leg.joints) gram += J_sole_.col(6 + joint) * J_sole_.col(6 + joint).transpose();
      const Eigen::LDLT<Matrix6> solver(gram);
      const Matrix6 base = solver.solve(Matrix6(J_sole_.leftCols<6>()));
      const Vector6d moving = J_sole_ * velocity_;
      const Vector6d damping = solver.solve(moving);
      for (const int joint : leg.joints) {
        T_.row(6 + joint) = -J_sole_.col(6 + joint).transpose() * base;
        t_[6 + joint] = -kSoleDamping * J_sole_.col(6 + joint).dot(damping);
      }
    }
  }

  // Horizontal acceleration of the centre of mass, vertical one of the pelvis, angular one of the pelvis; frame W.
  [[nodiscard]] Vector6d wanted_motion(const RobotState& state, const Reference& reference) const {
    const Eigen::Vector2d com = kinematics_.center_of_mass().head<2>();
    const Eigen::Vector2d com_velocity = J_com_.topRows<2>() * velocity_;
    const Eigen::Vector2d target = center_.head<2>() + shift_ + lean();
    Vector6d wanted;
    wanted.head<2>() = options_.com_stiffness * (target - com) - options_.com_damping * com_velocity;
    const double height = state.X_WB.p.z() - center_.z();
    wanted[2] =
        options_.height_stiffness * (robot_->standing_height - height) - options_.height_damping * state.v_WB.z();
    wanted.tail<3>() =
        options_.tilt_stiffness * tilt_error(state, reference) - options_.tilt_damping * (state.X_WB.R * state.w_WB_B);
    return wanted;
  }

  // Where the centre of mass is to be against the middle of the soles so that the centre of pressure is there under the
  // push.
  [[nodiscard]] Eigen::Vector2d lean() const {
    const double height = kinematics_.center_of_mass().z() - center_.z();
    const Eigen::Vector2d lean = lean_ - height / weight_ * push_;
    return std::min(1.0, kLeanRange / std::max(lean.norm(), 1e-9)) * lean;
  }

  // The part of the root's way from its resting place that is followed.
  [[nodiscard]] Eigen::Vector2d shift(const Reference& reference) const {
    const Eigen::Rotation2Dd stance(stance_yaw_);
    const Eigen::Vector2d asked = stance.inverse() * Eigen::Vector2d(reference.X_WB.p.head<2>() - root_rest_);
    return stance * Eigen::Vector2d(asked.cwiseMax(-shift_range_).cwiseMin(shift_range_));
  }

  // Rotation vector, in W, from the pelvis to upright with the reference's yaw.
  [[nodiscard]] Eigen::Vector3d tilt_error(const RobotState& state, const Reference& reference) const {
    const double asked = std::remainder(yaw_of(reference.X_WB.R) - stance_yaw_, 2.0 * EIGEN_PI);
    const Eigen::Quaterniond upright = yaw_rotation(stance_yaw_ + std::clamp(asked, -kYawRange, kYawRange));
    Eigen::Quaterniond turn = upright * state.X_WB.R.conjugate();
    if (turn.w() < 0.0) turn.coeffs() = -turn.coeffs();
    const Eigen::AngleAxisd error(turn);
    return std::min(error.angle(), kTiltRange) * error.axis();
  }

  const Eigen::VectorXd& plan_forces(const RobotState& state, const Vector6d& wanted) {
    Matrix6 Y = Matrix6::Zero();
    Y.topRows<2>().noalias() = J_com_.topRows<2>() * T_;
    Y(2, 2) = 1.0;
    Y.bottomRightCorner<3, 3>() = state.X_WB.R.toRotationMatrix();
    const Matrix6 base_mass = mass_.topRows<6>() * T_;
    Vector6d base_bias = bias_.head<6>() + mass_.topRows<6>() * t_;
    base_bias.noalias() -= J_com_.topLeftCorner<2, 6>().transpose() * push_;  // taken to act at the centre of mass
    const Eigen::PartialPivLU<Matrix6> solver(base_mass);
    A_ = J_.leftCols<6>().transpose();
    const Matrix6 inverse = solver.inverse();
    const Matrix6 to_motion = Y * inverse;
    G_.noalias() = to_motion * A_;
    Vector6d g = -to_motion * base_bias;
    g.head<2>() += J_com_.topRows<2>() * t_;
    Vector6d weights;
    weights << options_.com_weight, options_.com_weight, options_.height_weight, options_.tilt_weight,
        options_.tilt_weight, options_.yaw_weight;
    const Eigen::VectorXd& f = forces_.solve(G_, wanted - g, weights, f_rest_);
    const Vector6d a_base = inverse * (A_ * f - base_bias);
    a_ = t_;
    a_.noalias() += T_ * a_base;
    return f;
  }

  // Under a steady push the centre of pressure leaves its place (the middle, shifted as the reference asks): lean until
  // it is back.
  void lean_against(const Eigen::VectorXd& f) {
    double total = 0.0;
    planned_.setZero();
    Eigen::Vector2d moment = Eigen::Vector2d::Zero();
    for (int i = 0; i < stance_.points(); ++i) {
      planned_ += f.segment<2>(3 * i);
      total += f[3 * i + 2];
      moment += f[3 * i + 2] * points_.col(i).head<2>();
    }
    if (total < 0.1 * weight_) return;
    lean_ -= options_.pressure_gain * kTick * (moment / total - center_.head<2>() - shift_);
    lean_ *= std::min(1.0, kLeanRange / std::max(lean_.norm(), 1e-9));
  }

  [[nodiscard]] double upper_target(const Reference& reference, int joint) const {
    return std::clamp(reference.q[joint], lower_[joint] + kStopMargin, upper_[joint] - kStopMargin);
  }

  void fill(const RobotState& state, const Reference& reference, JointCommand& command) const {
    command.q_target = state.q;
    command.kp = card_.kp;
    command.kd = card_.kd;
    command.tau_ff = card_.tau_ff;
    for (const int joint : stance_.upper()) {
      command.q_target[joint] = upper_target(reference, joint);
      // Gravity, velocity terms and the acceleration of the base.
      command.tau_ff[joint] = bias_[6 + joint] + mass_.row(6 + joint).head<6>().dot(a_.head<6>());
    }
    for (const Leg& leg : stance_.legs())
      for (const int joint : leg.joints) fill_leg_joint(state, joint, command);
  }

  // The wanted torque in the middle of the tick if the joint moves as predicted.
  void fill_leg_joint(const RobotState& state, int joint, JointCommand& command) const {
    const double half = 0.5 * kTick, a = a_[6 + joint];
    command.kp[joint] *= options_.leg_stiffness_share;
    command.kd[joint] *= options_.leg_damping_share;
    command.q_target[joint] = state.q[joint] + half * (state.v[joint] + 0.5 * half * a);
    command.tau_ff[joint] = effort_[6 + joint] + command.kd[joint] * (state.v[joint] + half * a);
  }

  std::shared_ptr<const RobotModel> robot_;
  VmcOptions options_;
  Kinematics kinematics_;
  Dynamics dynamics_;
  Stance stance_;
  JointCommand card_;
  Eigen::VectorXd lower_, upper_;
  double weight_;                // [N]
  Eigen::Vector2d shift_range_;  // along x and y of the stance: what of the root's place is followed [m]
  ContactForces forces_;

  // Since reset.
  double stance_yaw_ = 0.0;
  Eigen::Vector2d root_rest_ = Eigen::Vector2d::Zero();  // of the root, with the centre of mass over the soles
  Eigen::Vector2d lean_ = Eigen::Vector2d::Zero();       // that brought the centre of pressure to the middle [m]
  Eigen::Vector2d push_ = Eigen::Vector2d::Zero();       // felt from outside [N]
  Eigen::Vector2d momentum_ = Eigen::Vector2d::Zero();   // a tick ago [N s]
  Eigen::Vector2d planned_ = Eigen::Vector2d::Zero();    // sum of the contact forces planned then [N]
  bool first_tick_ = true;

  // Values of this tick.
  Eigen::Vector2d shift_ = Eigen::Vector2d::Zero();
  Eigen::VectorXd velocity_, bias_, t_, a_, effort_, f_rest_, upper_pull_;
  Eigen::MatrixXd mass_, J_, J_com_, upper_mass_;
  Eigen::Matrix<double, Eigen::Dynamic, 6> T_;
  Eigen::Matrix3Xd points_;
  Matrix6Xd J_sole_, G_, A_;
  Eigen::LLT<Eigen::MatrixXd> upper_solver_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();  // of the soles' points
};

}  // namespace

std::unique_ptr<Controller> make_vmc_controller(std::shared_ptr<const RobotModel> robot) {
  return make_vmc_controller(std::move(robot), VmcOptions{});
}

std::unique_ptr<Controller> make_vmc_controller(std::shared_ptr<const RobotModel> robot, const VmcOptions& options) {
  return std::make_unique<Vmc>(std::move(robot), options);
}

// With z fixed, x and y are clamped to mu z; the derivative along z then vanishes at one of three values, according to
// how many of the two are clamped.
Eigen::Vector3d project_on_pyramid(const Eigen::Vector3d& f, double mu) {
  const double larger = std::max(std::abs(f.x()), std::abs(f.y()));
  const double smaller = std::min(std::abs(f.x()), std::abs(f.y()));
  double z = f.z();
  if (larger > mu * z) z = (f.z() + mu * larger) / (1.0 + mu * mu);
  if (smaller > mu * z) z = (f.z() + mu * (larger + smaller)) / (1.0 + 2.0 * mu * mu);
  z = std::max(z, 0.0);
  return {std::clamp(f.x(), -mu * z, mu * z), std::clamp(f.y(), -mu * z, mu * z), z};
}

ContactForces::ContactForces(int points, double friction, double regularisation, int iterations)
    : friction_(friction),
      regularisation_(regularisation),
      iterations_(iterations),
      A_(6, 3 * points),
      f_(Eigen::VectorXd::Zero(3 * points)),
      previous_(f_),
      y_(f_) {}

const Eigen::VectorXd& ContactForces::solve(const Matrix6Xd& G, const Vector6d& b, const Vector6d& weights,
                                            const Eigen::VectorXd& f_rest) {
  A_.noalias() = weights.asDiagonal() * G;
  const Vector6d target = weights.cwiseProduct(b);
  const Matrix6d gram = A_ * A_.transpose();  // its largest eigenvalue is that of the Hessian without regularisation
  const Eigen::SelfAdjointEigenSolver<Matrix6d> spectrum(gram, Eigen::EigenvaluesOnly);
  const double step = 1.0 / (spectrum.eigenvalues()[5] + regularisation_);
  y_ = f_;
  double momentum = 1.0;
  for (int iteration = 0; iteration < iterations_; ++iteration) {
    previous_ = f_;
    const Vector6d residual = A_ * y_ - target;
    f_.noalias() = y_ - step * regularisation_ * (y_ - f_rest);
    f_.noalias() -= step * (A_.transpose() * residual);
    for (Eigen::Index i = 0; i < f_.size(); i += 3) f_.segment<3>(i) = project_on_pyramid(f_.segment<3>(i), friction_);
    const double next = 0.5 * (1.0 + std::sqrt(1.0 + 4.0 * momentum * momentum));
    y_ = f_ + (momentum - 1.0) / next * (f_ - previous_);
    momentum = next;
  }
  return f_;
}

}  // namespace duet
