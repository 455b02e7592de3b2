// Bullet in its own world: btMultiBodyDynamicsWorld with its shapes, broad phase, persistent manifolds, warm start,
// contact rows and joint limits, set up as PyBullet's server does. The partner is a set of kinematic capsules.
#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyJointLimitConstraint.h>
#include <BulletDynamics/Featherstone/btMultiBodyJointMotor.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <btBulletDynamicsCommon.h>

#include <Eigen/Eigenvalues>
#include <memory>

#include "own_world.h"

namespace {

std::string engine_version() {
  return std::to_string(btGetVersion() / 100) + "." + std::to_string(btGetVersion() % 100);
}

btVector3 bt(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
btQuaternion bt(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }
btTransform bt(const duet::Pose& X) { return btTransform(bt(X.R), bt(X.p)); }
Eigen::Vector3d eigen(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
Eigen::Quaterniond eigen(const btQuaternion& q) { return {q.w(), q.x(), q.y(), q.z()}; }

// Sources: PhysicsServerCommandProcessor.cpp of Bullet 3.24 ("PyBullet"), btMultiBody.cpp.
const std::vector<duet::EngineOption> kOptions = {
    duet::integer_option("iterations", 50, 1, 1000, "of sequential impulses (PyBullet: numSolverIterations)"),
    duet::number_option("erp", 0.08, 0.0, 1.0, "of contacts (createEmptyDynamicsWorld: m_erp2)"),
    duet::number_option("warm_start", 0.1, 0.0, 1.0, "share of the impulse before (m_warmstartingFactor)"),
    duet::number_option("damping", 0.0, 0.0, 1.0, "of the multibody; its own 0.04 brakes a free fall within a second"),
    duet::choice_option("cone", {"cone", "pyramid"}, "of friction (SOLVER_DISABLE_IMPLICIT_CONE_FRICTION)")};

// A collision object stands for a link of the robot, a capsule of the partner, or the ground.
struct Body {
  int link = -1, capsule = -1;
};
Body body_of(const btCollisionObject* object) {
  if (const auto* collider = btMultiBodyLinkCollider::upcast(object)) return {.link = collider->m_link + 1};
  return {.capsule = object->getUserIndex()};
}

// Friction is the pair's: what Bullet made of two bodies' values is replaced between detection and rows.
class World final : public btMultiBodyDynamicsWorld {
 public:
  World(btDispatcher* dispatcher, btBroadphaseInterface* broadphase, btMultiBodyConstraintSolver* solver,
        btCollisionConfiguration* configuration, const duet::PairFriction& friction)
      : btMultiBodyDynamicsWorld(dispatcher, broadphase, solver, configuration), friction_(friction) {}
  void performDiscreteCollisionDetection() override {
    btMultiBodyDynamicsWorld::performDiscreteCollisionDetection();
    for (int m = 0; m < getDispatcher()->getNumManifolds(); ++m) {
      btPersistentManifold* manifold = getDispatcher()->getManifoldByIndexInternal(m);
      const Body a = body_of(manifold->getBody0()), b = body_of(manifold->getBody1());
      const double friction = a.link >= 0 && b.link >= 0         ? friction_.robot_robot
                              : a.capsule >= 0 || b.capsule >= 0 ? friction_.robot_human
                                                                 : friction_.robot_ground;
      for (int i = 0; i < manifold->getNumContacts(); ++i) manifold->getContactPoint(i).m_combinedFriction = friction;
    }
  }

 private:
  duet::PairFriction friction_;
};

// The row of a joint's motor, made soft: Bullet's target velocity, and the law's inertia as cfm.
class LawMotor final : public btMultiBodyJointMotor {
 public:
  LawMotor(btMultiBody* body, int link) : btMultiBodyJointMotor(body, link, 0.0, SIMD_INFINITY) {}
  own::LawRow law = {};

  void createConstraintRows(btMultiBodyConstraintArray& rows, btMultiBodyJacobianData& data,
                            const btContactSolverInfo& info) override {
    const int before = rows.size();
    if (law.inertia > 0.0) btMultiBodyJointMotor::createConstraintRows(rows, data, info);
    if (rows.size() == before) return;
    btMultiBodySolverConstraint& row = rows[before];
    const double softness = 1.0 / law.inertia;
    row.m_jacDiagABInv = 1.0 / (1.0 / row.m_jacDiagABInv + softness);
    row.m_cfm = softness * row.m_jacDiagABInv;
    row.m_rhs = (law.target - m_bodyA->getJointVel(m_linkA)) * row.m_jacDiagABInv;
  }
};

class BulletOwn final : public own::OwnWorld, btOverlapFilterCallback {
 public:
  explicit BulletOwn(const duet::Scene& scene) : OwnWorld(scene), n_(robot().dof()) {
    btDefaultCollisionConstructionInfo sizes;
    sizes.m_defaultMaxPersistentManifoldPoolSize = sizes.m_defaultMaxCollisionAlgorithmPoolSize = 256;
    configuration_ = std::make_unique<btDefaultCollisionConfiguration>(sizes);
    dispatcher_ = std::make_unique<btCollisionDispatcher>(configuration_.get());
    broadphase_.getOverlappingPairCache()->setOverlapFilterCallback(this);
    world_ = std::make_unique<World>(dispatcher_.get(), &broadphase_, &solver_, configuration_.get(), scene.friction);
    world_->setGravity(bt(Eigen::Vector3d(scene.gravity)));
    configure(world_->getSolverInfo());
    make_body();
    make_ground();
    for (int link = 0; link <= n_; ++link) make_collider(link);
    make_motors();
    make_limits();
    if (scene.partner == duet::PartnerMode::kSolid) make_partner();
    place();
  }
  ~BulletOwn() override {
    for (const auto& limit : limits_) world_->removeMultiBodyConstraint(limit.get());
    for (const auto& motor : motors_) world_->removeMultiBodyConstraint(motor.get());
    world_->removeMultiBody(body_.get());
    for (const auto& capsule : capsules_) world_->removeRigidBody(capsule.get());
    for (const auto& object : objects_) world_->removeCollisionObject(object.get());
  }
  BulletOwn(const BulletOwn&) = delete;
  BulletOwn& operator=(const BulletOwn&) = delete;

  [[nodiscard]] std::string_view name() const override { return "bullet_own"; }
  [[nodiscard]] std::string version() const override { return engine_version(); }

 private:
  void configure(btContactSolverInfo& info) const {
    const auto number = [&](const char* name) { return duet::option_number(scene().options, kOptions, name); };
    info.m_numIterations = duet::option_integer(scene().options, kOptions, "iterations");
    info.m_erp2 = number("erp");
    info.m_warmstartingFactor = number("warm_start");
    info.m_frictionERP = 0.2;                     // createEmptyDynamicsWorld
    info.m_linearSlop = 1e-5;                     // createEmptyDynamicsWorld
    info.m_leastSquaresResidualThreshold = 1e-7;  // createEmptyDynamicsWorld
    info.m_minimumSolverBatchSize = 0;            // every island on its own, in a fixed order
    if (duet::option_choice(scene().options, kOptions, "cone") == "pyramid")
      info.m_solverMode |= SOLVER_DISABLE_IMPLICIT_CONE_FRICTION;
  }

  // Bullet's links have their frames at the centre of mass, along the principal axes.
  void make_body() {
    std::vector<Eigen::Vector3d> moments;
    for (const duet::RobotLink& link : robot().links) {
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(link.inertia);
      Eigen::Matrix3d R = solver.eigenvectors();
      if (R.determinant() < 0.0) R.col(0) *= -1.0;
      R_LP_.push_back(R);
      moments.push_back(solver.eigenvalues());
    }
    body_ = std::make_unique<btMultiBody>(n_, robot().links[0].mass, bt(moments[0]), false, false);
    for (int i = 1; i <= n_; ++i) {
      const duet::RobotLink &link = robot().links[i], &parent = robot().links[link.parent];
      const Eigen::Matrix3d &R = R_LP_[i], &R_parent = R_LP_[link.parent];
      const Eigen::Matrix3d R_child_parent = R.transpose() * link.X_PL.R.toRotationMatrix().transpose() * R_parent;
      body_->setupRevolute(i - 1, link.mass, bt(moments[i]), link.parent - 1, bt(Eigen::Quaterniond(R_child_parent)),
                           bt(Eigen::Vector3d(R.transpose() * link.axis)),
                           bt(Eigen::Vector3d(R_parent.transpose() * (link.X_PL.p - parent.com))),
                           bt(Eigen::Vector3d(R.transpose() * link.com)), true);
    }
    body_->finalizeMultiDof();
    const double damping = duet::option_number(scene().options, kOptions, "damping");
    body_->setLinearDamping(damping);
    body_->setAngularDamping(damping);
    body_->setMaxCoordinateVelocity(duet::kDivergedSpeed);  // Bullet's own 100 cuts the speed of a long fall
    body_->setHasSelfCollision(true);
    world_->addMultiBody(body_.get());
  }

  void make_ground() {
    shapes_.push_back(std::make_unique<btStaticPlaneShape>(btVector3(0, 0, 1), 0.0));
    objects_.push_back(std::make_unique<btCollisionObject>());
    objects_.back()->setCollisionShape(shapes_.back().get());
    world_->addCollisionObject(objects_.back().get());
  }

  // Every link has one: Bullet passes over the limits of links without.
  void make_collider(int link) {
    auto compound = std::make_unique<btCompoundShape>();
    const Eigen::Matrix3d R_PL = R_LP_[link].transpose();
    for (const duet::RobotShape& shape : robot().shapes) {
      if (shape.link != link) continue;
      if (shape.kind == duet::ShapeKind::kSphere)
        shapes_.push_back(std::make_unique<btSphereShape>(shape.radius));
      else
        shapes_.push_back(std::make_unique<btCapsuleShapeZ>(shape.radius, 2.0 * shape.half_length));
      const duet::Pose X{Eigen::Quaterniond(R_PL * shape.X_LS.R.toRotationMatrix()),
                         R_PL * (shape.X_LS.p - robot().links[link].com)};
      compound->addChildShape(bt(X), shapes_.back().get());
    }
    auto collider = std::make_unique<btMultiBodyLinkCollider>(body_.get(), link - 1);
    collider->setCollisionShape(compound.get());
    if (link == 0)
      body_->setBaseCollider(collider.get());
    else
      body_->getLink(link - 1).m_collider = collider.get();
    world_->addCollisionObject(collider.get());
    shapes_.push_back(std::move(compound));
    objects_.push_back(std::move(collider));
  }

  void make_motors() {
    for (int i = 0; i < n_; ++i) {
      motors_.push_back(std::make_unique<LawMotor>(body_.get(), i));
      world_->addMultiBodyConstraint(motors_.back().get());
      motors_.back()->finalizeMultiDof();
    }
  }

  void make_limits() {
    for (int i = 0; i < n_; ++i) {
      const duet::RobotJoint& joint = robot().joints[i];
      limits_.push_back(std::make_unique<btMultiBodyJointLimitConstraint>(body_.get(), i, joint.lower, joint.upper));
      world_->addMultiBodyConstraint(limits_.back().get());
      limits_.back()->finalizeMultiDof();
    }
  }

  // The skin is Bullet's contact stiffness and damping (BT_CONTACT_FLAG_CONTACT_STIFFNESS_DAMPING): taken implicitly,
  // as erp = hK / (hK + D) and cfm = 1 / (hK + D).
  void make_partner() {
    for (int i = 0; i < static_cast<int>(scene().human.capsules.size()); ++i) {
      const duet::HumanCapsule& human = scene().human.capsules[i];
      auto shape = std::make_unique<btCapsuleShapeZ>(human.radius, 1.0);
      auto capsule = std::make_unique<btRigidBody>(0.0, nullptr, shape.get());
      capsule->setCollisionFlags(capsule->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
      capsule->setActivationState(DISABLE_DEACTIVATION);
      capsule->setUserIndex(i);
      capsule->setContactStiffnessAndDamping(human.skin.stiffness, human.skin.damping);
      world_->addRigidBody(capsule.get());
      shapes_.push_back(std::move(shape));
      capsules_.push_back(std::move(capsule));
    }
  }

  // Bullet finds a kinematic body's velocity from two transforms: the one before is set a step back along the partner's
  // own velocity, so that a partner that is put elsewhere does not arrive with meganewtons.
  void place_partner() {
    const duet::HumanJoints before = partner_.joints - scene().dt * partner_.velocities;
    for (int i = 0; i < static_cast<int>(capsules_.size()); ++i) {
      const duet::HumanCapsule& human = scene().human.capsules[i];
      const duet::CapsulePose now = duet::capsule_pose(human, partner_.joints);
      const duet::Pose away{Eigen::Quaterniond::Identity(), Eigen::Vector3d(3.0 * i, 0.0, 1e3)};
      const btTransform X = bt(partner_.present ? now.X_WC : away);
      capsules_[i]->setWorldTransform(X);
      capsules_[i]->setInterpolationWorldTransform(partner_.present ? bt(duet::capsule_pose(human, before).X_WC) : X);
      auto* shape = static_cast<btCapsuleShapeZ*>(capsules_[i]->getCollisionShape());
      shape->setImplicitShapeDimensions(btVector3(human.radius, human.radius, now.half_length));
    }
  }

  bool needBroadphaseCollision(btBroadphaseProxy* a, btBroadphaseProxy* b) const override {
    const Body first = body_of(static_cast<btCollisionObject*>(a->m_clientObject));
    const Body second = body_of(static_cast<btCollisionObject*>(b->m_clientObject));
    if (first.link < 0 || second.link < 0) return (first.link < 0) != (second.link < 0);
    return may_touch(first.link, second.link);
  }

  void place() override {
    forget_contacts();
    body_->clearVelocities();
    body_->clearConstraintForces();
    body_->clearForcesAndTorques();
    const Eigen::Vector3d r = state_.X_WB.R * robot().links[0].com, w = state_.X_WB.R * state_.w_WB_B;
    body_->setBasePos(bt(Eigen::Vector3d(state_.X_WB.p + r)));
    body_->setWorldToBaseRot(bt((state_.X_WB.R * Eigen::Quaterniond(R_LP_[0])).conjugate()));
    body_->setBaseOmega(bt(w));
    body_->setBaseVel(bt(Eigen::Vector3d(state_.v_WB + w.cross(r))));
    for (int i = 0; i < n_; ++i) {
      body_->setJointPos(i, state_.q[i]);
      body_->setJointVel(i, state_.v[i]);
    }
    btAlignedObjectArray<btQuaternion> q;
    btAlignedObjectArray<btVector3> v;
    body_->forwardKinematics(q, v);
    body_->updateCollisionObjectWorldTransforms(q, v);
    place_partner();
    forget();
  }

  // Manifolds, and the impulses in them.
  void forget() {
    const auto clean = [&](btCollisionObject& object) {
      broadphase_.getOverlappingPairCache()->cleanProxyFromPairs(object.getBroadphaseHandle(), dispatcher_.get());
    };
    for (const auto& object : objects_) clean(*object);
    for (const auto& capsule : capsules_) clean(*capsule);
    solver_.reset();
    broadphase_.resetPool(dispatcher_.get());
    world_->updateAabbs();
  }

  void do_kick(const Eigen::Vector3d& dv_W) override { body_->setBaseVel(body_->getBaseVel() + bt(dv_W)); }

  duet::Outcome advance(const duet::JointCommand& command) override {
    if (!find_torques(command)) return duet::Outcome::kDiverged;
    for (int i = 0; i < n_; ++i) {
      body_->addJointTorque(i, applied()[i]);
      motors_[i]->law = law_row(i);
    }
    for (int link = 0; link <= n_ && pushes_.any(); ++link) push(link);
    place_partner();
    world_->stepSimulation(scene().dt, 0);
    read();
    if (!duet::speeds_are_sane(state_)) return duet::Outcome::kDiverged;
    correct_torques();
    read_contacts();
    return duet::Outcome::kOk;
  }

  void push(int link) {
    const duet::ExternalForces::Push& push = pushes_.all()[link];
    if (push.f_W.isZero(0.0)) return;
    const btTransform X = link == 0 ? body_->getBaseWorldTransform() : body_->getLink(link - 1).m_cachedWorldTransform;
    const Eigen::Vector3d arm_L = R_LP_[link].transpose() * (push.p_L - robot().links[link].com);
    const Eigen::Vector3d arm_W = eigen(X.getRotation()) * arm_L, torque_W = arm_W.cross(push.f_W);
    if (link == 0) {
      body_->addBaseForce(bt(push.f_W));
      body_->addBaseTorque(bt(torque_W));
    } else {
      body_->addLinkForce(link - 1, bt(push.f_W));
      body_->addLinkTorque(link - 1, bt(torque_W));
    }
  }

  void read() {
    state_.X_WB.R =
        (eigen(body_->getWorldToBaseRot()).conjugate() * Eigen::Quaterniond(R_LP_[0]).conjugate()).normalized();
    const Eigen::Vector3d r = state_.X_WB.R * robot().links[0].com, w = eigen(body_->getBaseOmega());
    state_.X_WB.p = eigen(body_->getBasePos()) - r;
    state_.w_WB_B = state_.X_WB.R.conjugate() * w;
    state_.v_WB = eigen(body_->getBaseVel()) - w.cross(r);
    for (int i = 0; i < n_; ++i) {
      state_.q[i] = body_->getJointPos(i);
      state_.v[i] = body_->getJointVel(i);
    }
  }

  void read_contacts() {
    contacts_.clear();
    for (int m = 0; m < dispatcher_->getNumManifolds(); ++m) {
      const btPersistentManifold* manifold = dispatcher_->getManifoldByIndexInternal(m);
      const Body a = body_of(manifold->getBody0()), b = body_of(manifold->getBody1());
      for (int i = 0; i < manifold->getNumContacts(); ++i) {
        const btManifoldPoint& point = manifold->getContactPoint(i);
        if (point.m_appliedImpulse <= 0.0) continue;
        const Eigen::Vector3d on_a = (eigen(point.m_normalWorldOnB) * point.m_appliedImpulse +
                                      eigen(point.m_lateralFrictionDir1) * point.m_appliedImpulseLateral1 +
                                      eigen(point.m_lateralFrictionDir2) * point.m_appliedImpulseLateral2) /
                                     scene().dt;
        const Eigen::Vector3d p_W = 0.5 * eigen(point.getPositionWorldOnA() + point.getPositionWorldOnB());
        if (a.link >= 0)
          report(a.link, b.link, b.capsule, p_W, on_a, -point.getDistance());
        else
          report(b.link, -1, a.capsule, p_W, -on_a, -point.getDistance());
      }
    }
    end_contacts();
  }

  // Bullet has no way to write manifolds: a continuation finds its contacts anew.
  void append_to(std::vector<double>& values) const override { append_contacts(values); }
  void read_from(std::span<const double> values) override {
    place();
    read_contacts_from(values);
  }

  int n_;
  std::vector<Eigen::Matrix3d> R_LP_;  // principal axes of each link
  btDbvtBroadphase broadphase_;
  btMultiBodyConstraintSolver solver_;
  std::unique_ptr<btDefaultCollisionConfiguration> configuration_;
  std::unique_ptr<btCollisionDispatcher> dispatcher_;
  std::unique_ptr<World> world_;
  std::unique_ptr<btMultiBody> body_;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btCollisionObject>> objects_;
  std::vector<std::unique_ptr<btRigidBody>> capsules_;
  std::vector<std::unique_ptr<LawMotor>> motors_;
  std::vector<std::unique_ptr<btMultiBodyJointLimitConstraint>> limits_;
};

std::unique_ptr<duet::Backend> make(const duet::Scene& scene) { return std::make_unique<BulletOwn>(scene); }
const duet::EngineModule kModule = {.name = "bullet_own",
                                    .version = engine_version,
                                    .make = make,
                                    .options = kOptions,
                                    .bare_step_seconds = own::bare_step_seconds<BulletOwn>};

}  // namespace

DUET_ENGINE_MODULE(kModule)
