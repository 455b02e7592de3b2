#include "duet/backends/bullet/bullet_world.h"

namespace duet {
namespace {

constexpr int kRepeats = 4;  // each may bring further joints to their limit; seldom more than one

RowSettings row_settings(const EngineOptions& options) {
  const std::span<const EngineOption> known = bullet_options();
  return {.iterations = option_integer(options, known, "iterations"),
          .erp = option_number(options, known, "erp"),
          .push_out = option_number(options, known, "push_out"),
          .slop = option_number(options, known, "slop"),
          .stop_erp = option_number(options, known, "stop_erp")};
}

}  // namespace

std::span<const EngineOption> bullet_options() {
  constexpr RowSettings kDefault;
  static const std::vector<EngineOption> options = {
      integer_option("iterations", kDefault.iterations, 1, 1000, "sweeps of sequential impulses"),
      number_option("erp", kDefault.erp, 0.0, 1.0, "share of a rigid contact's depth that a step removes"),
      number_option("push_out", kDefault.push_out, 0.0, 100.0, "the most speed at which a step removes depth [m/s]"),
      number_option("slop", kDefault.slop, 0.0, 0.01, "depth at which a rigid contact rests [m]"),
      number_option("stop_erp", kDefault.stop_erp, 0.0, 1.0, "share of a joint stop's violation that a step removes")};
  return options;
}

BulletWorld::BulletWorld(const Scene& scene, std::size_t contacts)
    : dt_(scene.dt),
      robot_(scene.robot),
      articulation_(scene),
      law_(scene),
      rows_(scene, row_settings(scene.options), contacts),
      Q_(Eigen::VectorXd::Zero(6 + robot_->dof())),
      applied_(Q_),
      a_(Q_),
      before_(Q_),
      torques_(Eigen::VectorXd::Zero(robot_->dof())) {}

bool BulletWorld::begin(const RobotState& state, const JointCommand& command) { return law_.begin(state, command); }

// The law's limit is taken with the contact forces of the step: where a torque passes it, the step is made again.
void BulletWorld::step(std::span<const ContactPoint> points, const ExternalForces* pushes, RobotState& state,
                       Eigen::VectorXd& torques) {
  Q_.setZero();
  if (pushes != nullptr && pushes->any()) add_pushes(*pushes);
  rows_.set_contacts(points, kinematics());
  before_ = articulation_.velocity();
  solve(state.q);
  for (int again = 0; again < kRepeats && law_.saturate(a_); ++again) {
    articulation_.set_velocity(before_);
    solve(state.q);
  }
  law_.torques(a_, torques);
  articulation_.integrate(dt_);
  articulation_.read(state);
}

// Bullet's own algorithm knows only M: its torques must give the acceleration that M + S has without contacts; with
// them, the rows' response is that of M + S already.
void BulletWorld::solve(const Eigen::VectorXd& q) {
  law_.forces(Q_, a_);
  law_.factor().solve(a_);
  law_.equivalent_torques(a_, torques_);
  applied_ = Q_;
  applied_.tail(robot_->dof()) += torques_;
  articulation_.accelerate(applied_, kinematics().R_WL(0), dt_);
  rows_.solve(articulation_, law_.factor(), kinematics(), q);
  a_ = (articulation_.velocity() - before_) / dt_;
}

void BulletWorld::add_pushes(const ExternalForces& pushes) {
  for (int link = 0; link <= robot_->dof(); ++link) {
    const ExternalForces::Push& push = pushes.all()[link];
    if (push.f_W.isZero(0.0)) continue;
    const Eigen::Vector3d p_W = kinematics().p_WL(link) + kinematics().R_WL(link) * push.p_L;
    Q_.head<3>() += push.f_W;
    Q_.segment<3>(3) += kinematics().R_WL(0).transpose() * (p_W - kinematics().p_WL(0)).cross(push.f_W);
    for (int k = link; k > 0; k = robot_->links[k].parent) {
      const Eigen::Vector3d hinge = kinematics().R_WL(k) * robot_->links[k].axis;
      Q_[5 + k] += hinge.dot((p_W - kinematics().p_WL(k)).cross(push.f_W));
    }
  }
}

}  // namespace duet
