// DART in its own world: World::step, ODE's detector on the skeleton's shapes, DART's contact and joint-limit
// constraints, Dantzig's method with PGS behind it, joints that take forces, as gz-physics sets it up.
#include <dart/collision/CollisionFilter.hpp>
#include <dart/collision/CollisionObject.hpp>
#include <dart/collision/ode/OdeCollisionDetector.hpp>
#include <dart/config.hpp>
#include <dart/constraint/BoxedLcpConstraintSolver.hpp>
#include <dart/constraint/DantzigBoxedLcpSolver.hpp>
#include <dart/constraint/PgsBoxedLcpSolver.hpp>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/CapsuleShape.hpp>
#include <dart/dynamics/FreeJoint.hpp>
#include <dart/dynamics/PlaneShape.hpp>
#include <dart/dynamics/RevoluteJoint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/dynamics/SphereShape.hpp>
#include <dart/dynamics/WeldJoint.hpp>
#include <dart/simulation/World.hpp>

#include "own_world.h"

namespace {

namespace dd = dart::dynamics;

// Source: gz-physics 7, dartsim/src/WorldFeatures.cc (detector "ode", solver "dantzig" by default).
const std::vector<duet::EngineOption> kOptions = {
    duet::choice_option("solver", {"dantzig", "pgs"}, "of the contact problem (SetWorldSolver)")};

Eigen::Isometry3d isometry(const duet::Pose& pose) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() = pose.R.normalized().toRotationMatrix();
  X.translation() = pose.p;
  return X;
}

// -1: the ground.
int link_of(const dart::collision::CollisionObject* object, const dd::Skeleton* robot) {
  const dd::ShapeNode* node = object->getShapeFrame()->asShapeNode();
  return node->getSkeleton().get() != robot ? -1 : static_cast<int>(node->getBodyNodePtr()->getIndexInSkeleton());
}

using MayTouch = std::function<bool(int, int)>;

struct LinkFilter final : dart::collision::CollisionFilter {
  const dd::Skeleton* robot = nullptr;
  MayTouch may_touch;
  bool ignoresCollision(const dart::collision::CollisionObject* a,
                        const dart::collision::CollisionObject* b) const override {
    const int i = link_of(a, robot), j = link_of(b, robot);
    return i < 0 || j < 0 ? i == j : !may_touch(i, j);
  }
};

class DartOwn final : public own::OwnWorld {
 public:
  explicit DartOwn(const duet::Scene& scene) : OwnWorld(scene), n_(robot().dof()) {
    using Solver = dart::constraint::BoxedLcpConstraintSolver;
    world_ = dart::simulation::World::create();
    world_->setTimeStep(scene.dt);
    world_->setGravity(scene.gravity);
    const auto dantzig = std::make_shared<dart::constraint::DantzigBoxedLcpSolver>();
    const auto pgs = std::make_shared<dart::constraint::PgsBoxedLcpSolver>();
    if (duet::option_choice(scene.options, kOptions, "solver") == "dantzig")
      world_->setConstraintSolver(std::make_unique<Solver>(dantzig, pgs));
    else
      world_->setConstraintSolver(std::make_unique<Solver>(pgs, nullptr));
    world_->getConstraintSolver()->setCollisionDetector(dart::collision::OdeCollisionDetector::create());
    make_ground();
    skeleton_ = dd::Skeleton::create("robot");
    for (int link = 0; link <= n_; ++link) make_link(link);
    skeleton_->enableSelfCollisionCheck();
    world_->addSkeleton(skeleton_);
    auto filter = std::make_shared<LinkFilter>();
    filter->robot = skeleton_.get();
    filter->may_touch = [this](int i, int j) { return may_touch(i, j); };
    world_->getConstraintSolver()->getCollisionOption().collisionFilter = filter;
    place();
  }

  [[nodiscard]] std::string_view name() const override { return "dart_own"; }
  [[nodiscard]] std::string version() const override { return DART_VERSION; }

 private:
  void add_shape(dd::BodyNode* body, const dd::ShapePtr& shape, const duet::Pose& X_LS, double friction) {
    auto* node = body->createShapeNodeWith<dd::CollisionAspect, dd::DynamicsAspect>(shape);
    node->setRelativeTransform(isometry(X_LS));
    node->getDynamicsAspect()->setFrictionCoeff(friction);
  }

  // DART takes the lower of two frictions: that of the ground is the pair's where links have more. Links have that of
  // the robot with itself, which holds for the ground where it is the greater.
  void make_ground() {
    const auto ground = dd::Skeleton::create("ground");
    dd::BodyNode* body = ground->createJointAndBodyNodePair<dd::WeldJoint>().second;
    add_shape(body, std::make_shared<dd::PlaneShape>(Eigen::Vector3d::UnitZ(), 0.0), {}, scene().friction.robot_ground);
    world_->addSkeleton(ground);
  }

  void make_link(int index) {
    const duet::RobotLink& link = robot().links[index];
    const dd::BodyNode::Properties named{
        dd::BodyNode::AspectProperties(std::string("l").append(std::to_string(index)))};
    dd::BodyNode* body = nullptr;
    if (index == 0)
      std::tie(base_, body) =
          skeleton_->createJointAndBodyNodePair<dd::FreeJoint>(nullptr, dd::FreeJoint::Properties(), named);
    else
      body = make_hinge(index, named);
    body->setInertia(dd::Inertia(link.mass, link.com, link.inertia));
    bodies_.push_back(body);
    for (const duet::RobotShape& shape : robot().shapes) {
      if (shape.link != index) continue;
      dd::ShapePtr form;
      if (shape.kind == duet::ShapeKind::kSphere)
        form = std::make_shared<dd::SphereShape>(shape.radius);
      else
        form = std::make_shared<dd::CapsuleShape>(shape.radius, 2.0 * shape.half_length);
      add_shape(body, form, shape.X_LS, std::max(scene().friction.robot_ground, scene().friction.robot_robot));
    }
  }

  dd::BodyNode* make_hinge(int index, const dd::BodyNode::Properties& named) {
    const duet::RobotLink& link = robot().links[index];
    const duet::RobotJoint& joint = robot().joints[index - 1];
    dd::RevoluteJoint::Properties properties;
    properties.mName = std::string("j").append(std::to_string(index - 1));
    properties.mAxis = link.axis;
    properties.mT_ParentBodyToJoint = isometry(link.X_PL);
    properties.mPositionLowerLimits[0] = joint.lower;
    properties.mPositionUpperLimits[0] = joint.upper;
    const auto [hinge, body] =
        skeleton_->createJointAndBodyNodePair<dd::RevoluteJoint>(bodies_[link.parent], properties, named);
    hinge->setActuatorType(dd::Joint::FORCE);
    hinge->setLimitEnforcement(true);
    hinges_.push_back(hinge);
    return body;
  }

  void place() override {
    forget_contacts();
    skeleton_->clearConstraintImpulses();
    skeleton_->clearExternalForces();
    skeleton_->resetCommands();
    skeleton_->resetAccelerations();
    world_->getConstraintSolver()->clearLastCollisionResult();
    base_->setPositions(dd::FreeJoint::convertToPositions(isometry(state_.X_WB)));
    set_base_velocity();
    for (int i = 0; i < n_; ++i) {
      hinges_[i]->setPosition(0, state_.q[i]);
      hinges_[i]->setVelocity(0, state_.v[i]);
    }
  }
  void do_kick(const Eigen::Vector3d&) override { set_base_velocity(); }

  // Angular first, both in the axes of the base.
  void set_base_velocity() {
    Eigen::Vector6d V;
    V << state_.w_WB_B, state_.X_WB.R.conjugate() * state_.v_WB;
    base_->setVelocities(V);
  }

  duet::Outcome advance(const duet::JointCommand& command) override {
    if (!find_torques(command)) return duet::Outcome::kDiverged;
    for (int i = 0; i < n_; ++i) hinges_[i]->setForce(0, applied()[i]);
    for (int link = 0; link <= n_ && pushes_.any(); ++link)
      if (const duet::ExternalForces::Push& push = pushes_.all()[link]; !push.f_W.isZero(0.0))
        bodies_[link]->addExtForce(push.f_W, push.p_L);
    world_->step();
    read();
    if (!duet::speeds_are_sane(state_)) return duet::Outcome::kDiverged;
    read_contacts();
    return duet::Outcome::kOk;
  }

  void read() {
    const Eigen::Isometry3d& X_WB = bodies_[0]->getWorldTransform();
    const Eigen::Vector6d V = base_->getVelocities();
    state_.X_WB.p = X_WB.translation();
    state_.X_WB.R = Eigen::Quaterniond(X_WB.linear()).normalized();
    state_.v_WB = X_WB.linear() * V.tail<3>();
    state_.w_WB_B = V.head<3>();
    for (int i = 0; i < n_; ++i) {
      state_.q[i] = hinges_[i]->getPosition(0);
      state_.v[i] = hinges_[i]->getVelocity(0);
    }
  }

  // A point of the ground lies at the bottom of the shape, the others in the middle of the overlap.
  void read_contacts() {
    contacts_.clear();
    for (const dart::collision::Contact& c : world_->getLastCollisionResult().getContacts()) {
      const int i = link_of(c.collisionObject1, skeleton_.get()), j = link_of(c.collisionObject2, skeleton_.get());
      Eigen::Vector3d p_W = c.point;
      if (i < 0 || j < 0) p_W.z() += 0.5 * c.penetrationDepth;
      if (i >= 0)
        report(i, j, -1, p_W, c.force, c.penetrationDepth);
      else
        report(j, -1, -1, p_W, -c.force, c.penetrationDepth);
    }
    end_contacts();
  }

  void append_to(std::vector<double>& values) const override {
    append_contacts(values);
    const Eigen::VectorXd q = skeleton_->getPositions(), v = skeleton_->getVelocities();
    values.insert(values.end(), q.data(), q.data() + q.size());
    values.insert(values.end(), v.data(), v.data() + v.size());
  }
  void read_from(std::span<const double> values) override {
    const auto size = static_cast<Eigen::Index>(skeleton_->getNumDofs());
    place();
    const double* from = read_contacts_from(values).data();
    skeleton_->setPositions(Eigen::Map<const Eigen::VectorXd>(from, size));
    skeleton_->setVelocities(Eigen::Map<const Eigen::VectorXd>(from + size, size));
  }

  int n_;
  dart::simulation::WorldPtr world_;
  dd::SkeletonPtr skeleton_;
  dd::FreeJoint* base_ = nullptr;
  std::vector<dd::RevoluteJoint*> hinges_;
  std::vector<dd::BodyNode*> bodies_;
};

std::string version() { return DART_VERSION; }
std::unique_ptr<duet::Backend> make(const duet::Scene& scene) { return std::make_unique<DartOwn>(scene); }
const duet::EngineModule kModule = {
    .name = "dart_own",
    .version = version,
    .make = make,
    .options = kOptions,
    .bare_step_seconds = own::bare_step_seconds<DartOwn>,
    .no_solid_partner = "DART's contact constraint is rigid: it has no stiffness and damping of a pair"};

}  // namespace

DUET_ENGINE_MODULE(kModule)
