// DART in its own world: World::step, ODE's detector on the skeleton's shapes, DART's contact and joint-limit
// constraints, Dantzig's method with PGS behind it, joints that take forces, as gz-physics sets it up. The partner is a
// skeleton of capsules that does not move by itself.
#include <dart/collision/CollisionFilter.hpp>
#include <dart/collision/CollisionGroup.hpp>
#include <dart/collision/CollisionObject.hpp>
#include <dart/collision/ode/OdeCollisionDetector.hpp>
#include <dart/config.hpp>
#include <dart/constraint/BoxedLcpConstraintSolver.hpp>
#include <dart/constraint/ConstraintBase.hpp>
#include <dart/constraint/ContactConstraint.hpp>
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
#include <mutex>

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

// DART's detector initialises ODE when it is made and closes it when it goes, by a count that no lock guards: one world
// at a time does either, and one detector stays.
std::mutex& of_detectors() {
  static std::mutex mutex;
  return mutex;
}
dart::collision::CollisionDetectorPtr make_detector() {
  const std::lock_guard lock(of_detectors());
  static const auto stays = dart::collision::OdeCollisionDetector::create();
  return dart::collision::OdeCollisionDetector::create();
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

// A contact with the partner's skin. DART's constraint has one softness for all contacts of the process and corrects
// overlap by 1 mm/s at most (ContactConstraint.cpp: DART_CFM, DART_MAX_ERV); its normal row gets the pair's spring and
// damper, taken implicitly: erp = hK / (hK + D), cfm = 1 / (hK + D). Friction is the pair's, in DART's pyramid.
class SkinContact final : public dart::constraint::ContactConstraint {
 public:
  // `contact` has the depth 0, else DART corrects it too, and outlives this. `depth` [m], `step` [s].
  SkinContact(dart::collision::Contact& contact, double step, const duet::ContactCompliance& skin, double depth,
              double friction)
      : ContactConstraint(contact, step),
        push_out_(skin.stiffness * depth / (step * skin.stiffness + skin.damping)),
        softness_(1.0 / (step * (step * skin.stiffness + skin.damping))),
        friction_(friction) {}

 protected:
  void getInformation(dart::constraint::ConstraintInfo* info) override {
    ContactConstraint::getInformation(info);
    info->b[0] += push_out_;
    for (std::size_t row = 1; row < getDimension(); ++row) {
      info->lo[row] = -friction_;
      info->hi[row] = friction_;
    }
  }
  void applyUnitImpulse(std::size_t row) override {
    ContactConstraint::applyUnitImpulse(row);
    unit_row_ = row;
  }
  void getVelocityChange(double* change, bool with_cfm) override {
    ContactConstraint::getVelocityChange(change, with_cfm);
    if (with_cfm && unit_row_ == 0) change[0] += softness_;
  }

 private:
  double push_out_;  // speed at which the skin would separate the pair [m/s]
  double softness_;  // change of that speed by an impulse [1/kg]
  double friction_;
  std::size_t unit_row_ = 0;
};

// The joints' law as rows of DART's solver: impulses that leave v + impulse / inertia at its target.
class LawRows final : public dart::constraint::ConstraintBase {
 public:
  struct Row {
    dd::RevoluteJoint* joint;
    own::LawRow law;
  };
  explicit LawRows(dd::SkeletonPtr skeleton) : skeleton_(std::move(skeleton)) {}
  void clear() {
    rows_.clear();
    mDim = 0;
  }
  void add(const Row& row) {
    rows_.push_back(row);
    mDim = rows_.size();
  }

 protected:
  void update() override {}
  bool isActive() const override { return mDim > 0; }
  dd::SkeletonPtr getRootSkeleton() const override { return ConstraintBase::getRootSkeleton(skeleton_); }
  void getInformation(dart::constraint::ConstraintInfo* info) override {
    for (std::size_t i = 0; i < mDim; ++i) {
      info->x[i] = info->w[i] = 0.0;
      info->findex[i] = -1;
      info->lo[i] = -std::numeric_limits<double>::infinity();
      info->hi[i] = std::numeric_limits<double>::infinity();
      info->b[i] = rows_[i].law.target - rows_[i].joint->getVelocity(0);
    }
  }
  void applyUnitImpulse(std::size_t index) override {
    dd::RevoluteJoint* joint = rows_[index].joint;
    skeleton_->clearConstraintImpulses();
    joint->setConstraintImpulse(0, 1.0);
    skeleton_->updateBiasImpulse(joint->getChildBodyNode());
    skeleton_->updateVelocityChange();
    joint->setConstraintImpulse(0, 0.0);
    unit_ = index;
  }
  void getVelocityChange(double* change, bool with_cfm) override {
    for (std::size_t i = 0; i < mDim; ++i) change[i] = rows_[i].joint->getVelocityChange(0);
    if (with_cfm) change[unit_] += 1.0 / rows_[unit_].law.inertia;
  }
  void excite() override { skeleton_->setImpulseApplied(true); }
  void unexcite() override { skeleton_->setImpulseApplied(false); }
  void applyImpulse(double* impulse) override {
    for (std::size_t i = 0; i < mDim; ++i)
      rows_[i].joint->setConstraintImpulse(0, rows_[i].joint->getConstraintImpulse(0) + impulse[i]);
  }

 private:
  dd::SkeletonPtr skeleton_;
  std::vector<Row> rows_;
  std::size_t unit_ = 0;
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
    world_->getConstraintSolver()->setCollisionDetector(make_detector());
    make_ground();
    skeleton_ = dd::Skeleton::create("robot");
    for (int link = 0; link <= n_; ++link) make_link(link);
    skeleton_->enableSelfCollisionCheck();
    law_rows_ = std::make_shared<LawRows>(skeleton_);
    world_->addSkeleton(skeleton_);
    auto filter = std::make_shared<LinkFilter>();
    filter->robot = skeleton_.get();
    filter->may_touch = [this](int i, int j) { return may_touch(i, j); };
    world_->getConstraintSolver()->getCollisionOption().collisionFilter = filter;
    if (scene.partner == duet::PartnerMode::kSolid) make_partner();
    place();
  }

  ~DartOwn() override {
    const std::lock_guard lock(of_detectors());
    robot_group_.reset();
    partner_group_.reset();
    world_.reset();
  }
  DartOwn(const DartOwn&) = delete;
  DartOwn& operator=(const DartOwn&) = delete;

  [[nodiscard]] std::string_view name() const override { return "dart_own"; }
  [[nodiscard]] std::string version() const override { return DART_VERSION; }

 private:
  struct Capsule {
    dd::FreeJoint* joint;
    std::shared_ptr<dd::CapsuleShape> shape;
    dd::ShapeNode* node;
  };
  struct Touched {
    int link, capsule;
    double depth;
    dart::collision::Contact contact;
  };

  dd::ShapeNode* add_shape(dd::BodyNode* body, const dd::ShapePtr& shape, const duet::Pose& X_LS, double friction) {
    auto* node = body->createShapeNodeWith<dd::CollisionAspect, dd::DynamicsAspect>(shape);
    node->setRelativeTransform(isometry(X_LS));
    node->getDynamicsAspect()->setFrictionCoeff(friction);
    return node;
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

  // The partner is not in the world, where DART would make rigid contacts with it.
  void make_partner() {
    humans_ = dd::Skeleton::create("partner");
    const auto detector = world_->getConstraintSolver()->getCollisionDetector();
    robot_group_ = detector->createCollisionGroup(skeleton_.get());
    partner_group_ = detector->createCollisionGroup();
    for (const duet::HumanCapsule& human : scene().human.capsules) {
      const std::string number = std::to_string(capsules_.size());
      dd::FreeJoint::Properties joint_named;
      joint_named.mName = std::string("h").append(number);
      const dd::BodyNode::Properties named{dd::BodyNode::AspectProperties(std::string("c").append(number))};
      const auto [joint, body] = humans_->createJointAndBodyNodePair<dd::FreeJoint>(nullptr, joint_named, named);
      const auto shape = std::make_shared<dd::CapsuleShape>(human.radius, 0.1);
      capsules_.push_back({joint, shape, add_shape(body, shape, {}, 1.0)});
      partner_group_->addShapeFrame(capsules_.back().node);
    }
    humans_->setMobile(false);
    touched_.reserve(narrow_phase_.capacity());
  }

  // A capsule moves as a rigid body with the velocities of its ends. The detector does not follow a shape's height: a
  // capsule that became longer by 10 um or more enters its group anew.
  void place_partner() {
    for (std::size_t i = 0; i < capsules_.size(); ++i) {
      const duet::HumanCapsule& human = scene().human.capsules[i];
      const duet::CapsulePose pose = duet::capsule_pose(human, partner_.joints);
      const auto ends = human.ends(partner_.joints), speeds = human.ends(partner_.velocities);
      const Eigen::Vector3d axis = ends[1] - ends[0];
      capsules_[i].joint->setTransform(isometry(pose.X_WC));
      capsules_[i].joint->setLinearVelocity(duet::capsule_velocity(human, partner_, pose.X_WC.p));
      capsules_[i].joint->setAngularVelocity(axis.cross(speeds[1] - speeds[0]) / std::max(1e-12, axis.squaredNorm()));
      const double height = std::max(1e-5, 1e-5 * std::round(2e5 * pose.half_length));
      if (capsules_[i].shape->getHeight() == height) continue;
      partner_group_->removeShapeFrame(capsules_[i].node);
      capsules_[i].shape->setHeight(height);
      partner_group_->addShapeFrame(capsules_[i].node);
    }
  }

  // Points between robot and partner become constraints of the step, in an order that no space decides.
  void touch_partner() {
    touched_.clear();
    if (capsules_.empty() || !partner_.present) return;
    place_partner();
    dart::collision::CollisionResult found;
    robot_group_->collide(partner_group_.get(), {true, narrow_phase_.capacity()}, &found);
    for (const dart::collision::Contact& contact : found.getContacts()) {
      const int i = link_of(contact.collisionObject1, skeleton_.get());
      const dart::collision::CollisionObject* human = i >= 0 ? contact.collisionObject2 : contact.collisionObject1;
      touched_.push_back({i >= 0 ? i : link_of(contact.collisionObject2, skeleton_.get()),
                          link_of(human, humans_.get()), contact.penetrationDepth, contact});
    }
    std::stable_sort(touched_.begin(), touched_.end(), [](const Touched& a, const Touched& b) {
      return std::tie(a.link, a.capsule, a.contact.point.x(), a.contact.point.y()) <
             std::tie(b.link, b.capsule, b.contact.point.x(), b.contact.point.y());
    });
    for (Touched& touched : touched_) add_skin(touched);
  }

  // The points of a pair of shapes share its spring and damper.
  void add_skin(Touched& touched) {
    const auto of_pair = static_cast<double>(std::count_if(touched_.begin(), touched_.end(), [&](const Touched& other) {
      return other.contact.collisionObject1 == touched.contact.collisionObject1 &&
             other.contact.collisionObject2 == touched.contact.collisionObject2;
    }));
    duet::ContactCompliance skin = scene().human.capsules[touched.capsule].skin;
    skin.stiffness /= of_pair;
    skin.damping /= of_pair;
    touched.contact.penetrationDepth = 0.0;
    world_->getConstraintSolver()->addConstraint(
        std::make_shared<SkinContact>(touched.contact, scene().dt, skin, touched.depth, scene().friction.robot_human));
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
    world_->getConstraintSolver()->removeAllConstraints();
    add_law_rows();
    for (int link = 0; link <= n_ && pushes_.any(); ++link)
      if (const duet::ExternalForces::Push& push = pushes_.all()[link]; !push.f_W.isZero(0.0))
        bodies_[link]->addExtForce(push.f_W, push.p_L);
    touch_partner();
    world_->step();
    read();
    if (!duet::speeds_are_sane(state_)) return duet::Outcome::kDiverged;
    correct_torques();
    read_contacts();
    return duet::Outcome::kOk;
  }

  void add_law_rows() {
    law_rows_->clear();
    for (int i = 0; i < n_; ++i)
      if (const own::LawRow law = law_row(i); law.inertia > 0.0) law_rows_->add({hinges_[i], law});
    world_->getConstraintSolver()->addConstraint(law_rows_);
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
    for (const Touched& touched : touched_) {
      const bool first = link_of(touched.contact.collisionObject1, skeleton_.get()) >= 0;
      const Eigen::Vector3d f_W = first ? touched.contact.force : Eigen::Vector3d(-touched.contact.force);
      report(touched.link, -1, touched.capsule, touched.contact.point, f_W, touched.depth);
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
  std::shared_ptr<LawRows> law_rows_;
  dd::FreeJoint* base_ = nullptr;
  std::vector<dd::RevoluteJoint*> hinges_;
  std::vector<dd::BodyNode*> bodies_;
  dd::SkeletonPtr humans_;
  std::vector<Capsule> capsules_;
  dart::collision::CollisionGroupPtr robot_group_, partner_group_;
  std::vector<Touched> touched_;
};

std::string version() { return DART_VERSION; }
std::unique_ptr<duet::Backend> make(const duet::Scene& scene) { return std::make_unique<DartOwn>(scene); }
const duet::EngineModule kModule = {.name = "dart_own",
                                    .version = version,
                                    .make = make,
                                    .options = kOptions,
                                    .bare_step_seconds = own::bare_step_seconds<DartOwn>};

}  // namespace

DUET_ENGINE_MODULE(kModule)
