// ODE in its own world: a hash space, dCollide, contact joints with the friction pyramid, hinges with stops, and
// dWorldQuickStep or dWorldStep, set up as Gazebo classic does. The partner is a set of capsules without a body.
#include <ode/ode.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <numbers>

#include "duet/robots/kinematics.h"
#include "own_world.h"

namespace {

// Sources: Gazebo 11's ODEPhysics.cc and the SDF specification's <physics><ode> and <surface><contact><ode>.
const std::vector<duet::EngineOption> kOptions = {
    duet::choice_option("stepper", {"world", "quick"}, "dWorldStep, or Gazebo's dWorldQuickStep"),
    duet::integer_option("iterations", 50, 1, 10000, "of QuickStep (SDF: solver/iters)"),
    duet::number_option("sor", 1.3, 0.1, 2.0, "over-relaxation of QuickStep (SDF: solver/sor)"),
    duet::number_option("erp", 0.2, 0.0, 1.0, "of hinges (SDF: constraints/erp)"),
    duet::number_option("kp", 1e12, 1.0, 1e15, "stiffness of a surface (SDF: contact/ode/kp) [N/m]"),
    duet::number_option("kd", 1.0, 0.0, 1e9, "damping of a surface (SDF: contact/ode/kd) [N s/m]"),
    duet::number_option("max_vel", 0.01, 0.0, 1e6,
                        "speed at which overlap goes at most (SDF: contact/ode/max_vel) [m/s]"),
    duet::number_option("surface_layer", 0.001, 0.0, 0.1, "overlap that is let be (SDF: contact_surface_layer) [m]")};

constexpr int kPointsOfAPair = 4;

[[noreturn]] void fail(int number, const char* format, va_list arguments) {
  std::array<char, 500> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  throw std::runtime_error(std::string("ode_own: ") + text.data() + " (error " + std::to_string(number) + ")");
}
void say_nothing(int, const char*, va_list) {}

// ODE's handlers are of the process: set as the module is loaded, before threads could race for ODE's own count.
struct Library {
  Library() {
    dInitODE2(0);
    dSetErrorHandler(fail);
    dSetDebugHandler(fail);
    dSetMessageHandler(say_nothing);
  }
};
const Library kLibrary;

// Its data are of each thread.
void enter() {
  struct ThreadData {
    ThreadData() { dAllocateODEDataForThread(dAllocateMaskAll); }
    ~ThreadData() { dCleanupODEAllDataForThread(); }
  };
  thread_local const ThreadData data;
}

Eigen::Vector3d eigen(const dReal* v) { return {v[0], v[1], v[2]}; }

class OdeOwn final : public own::OwnWorld {
 public:
  explicit OdeOwn(const duet::Scene& scene)
      : OwnWorld((enter(), scene)), n_(robot().dof()), kinematics_(robot()), feedback_(narrow_phase_.capacity()) {
    const auto number = [&](const char* name) { return duet::option_number(scene.options, kOptions, name); };
    quick_ = duet::option_choice(scene.options, kOptions, "stepper") == "quick";
    const double kp = 0.5 * number("kp"), kd = 2.0 * number("kd");  // Gazebo: two surfaces in series, dampings added
    layer_ = number("surface_layer");
    deepest_ = number("max_vel") * (scene.dt + kd / kp);  // what is taken back at max_vel: max_vel dt / erp
    rigid_ = {.erp = scene.dt * kp / (scene.dt * kp + kd), .cfm = 1.0 / (scene.dt * kp + kd)};
    threading_ = dThreadingAllocateSelfThreadedImplementation();
    world_ = dWorldCreate();
    dWorldSetStepThreadingImplementation(world_, dThreadingImplementationGetFunctions(threading_), threading_);
    dWorldSetGravity(world_, scene.gravity.x(), scene.gravity.y(), scene.gravity.z());
    dWorldSetERP(world_, number("erp"));
    dWorldSetCFM(world_, 0.0);  // SDF: constraints/cfm
    dWorldSetQuickStepNumIterations(world_, duet::option_integer(scene.options, kOptions, "iterations"));
    dWorldSetQuickStepW(world_, number("sor"));
    dWorldSetAutoDisableFlag(world_, 0);
    group_ = dJointGroupCreate(0);
    space_ = dHashSpaceCreate(nullptr);
    tag(dCreatePlane(space_, 0, 0, 1, 0), kGround);
    make_bodies();
    make_hinges();
    if (scene.partner == duet::PartnerMode::kSolid) make_partner();
    put(state_);
  }
  ~OdeOwn() override {
    enter();
    dJointGroupDestroy(group_);
    dSpaceDestroy(space_);
    dWorldDestroy(world_);
    dThreadingFreeImplementation(threading_);
  }
  OdeOwn(const OdeOwn&) = delete;
  OdeOwn& operator=(const OdeOwn&) = delete;

  [[nodiscard]] std::string_view name() const override { return "ode_own"; }
  [[nodiscard]] std::string version() const override { return dODE_VERSION; }

 private:
  // A geom stands for a link (0, 1, ...), the ground, or a capsule of the partner (kPartner, kPartner - 1, ...).
  static constexpr int kGround = -1, kPartner = -2;
  static void tag(dGeomID geom, int what) { dGeomSetData(geom, reinterpret_cast<void*>(std::intptr_t{what})); }
  static int tag_of(dGeomID geom) { return static_cast<int>(reinterpret_cast<std::intptr_t>(dGeomGetData(geom))); }

  struct Softness {
    double erp = 0.0, cfm = 0.0;
  };
  struct Found {
    int link, other, of_pair;  // tags; points of the pair
    dContactGeom geom;         // its normal points into the link
  };
  struct Touched {
    int link = -1, other = -1, capsule = -1;
    Eigen::Vector3d p_W;
    double depth = 0.0;
  };

  void make_bodies() {
    for (const duet::RobotLink& link : robot().links) {
      const dBodyID body = dBodyCreate(world_);
      const Eigen::Matrix3d& I = link.inertia;
      dMass mass;
      dMassSetParameters(&mass, link.mass, 0, 0, 0, I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
      dBodySetMass(body, &mass);
      bodies_.push_back(body);
    }
    for (const duet::RobotShape& shape : robot().shapes) {
      const dGeomID geom = shape.kind == duet::ShapeKind::kSphere
                               ? dCreateSphere(space_, shape.radius)
                               : dCreateCapsule(space_, shape.radius, 2.0 * shape.half_length);
      dGeomSetBody(geom, bodies_[shape.link]);
      const Eigen::Vector3d p = shape.X_LS.p - robot().links[shape.link].com;
      const Eigen::Quaterniond& R = shape.X_LS.R;
      const dQuaternion quat_wxyz = {R.w(), R.x(), R.y(), R.z()};
      dGeomSetOffsetPosition(geom, p.x(), p.y(), p.z());
      dGeomSetOffsetQuaternion(geom, quat_wxyz);
      tag(geom, shape.link);
    }
  }

  // Hinges are made where all angles are 0. ODE holds no stop beyond half a turn: such a joint has none.
  void make_hinges() {
    duet::RobotState zero = state_;
    zero.q.setZero();
    put(zero);
    for (int i = 0; i < n_; ++i) {
      const duet::RobotLink& link = robot().links[i + 1];
      const duet::RobotJoint& joint = robot().joints[i];
      const dJointID hinge = dJointCreateHinge(world_, nullptr);
      dJointAttach(hinge, bodies_[i + 1], bodies_[link.parent]);
      const Eigen::Vector3d p = kinematics_.p_WL(i + 1), axis = kinematics_.R_WL(i + 1) * link.axis;
      dJointSetHingeAnchor(hinge, p.x(), p.y(), p.z());
      dJointSetHingeAxis(hinge, axis.x(), axis.y(), axis.z());
      if (joint.lower > -std::numbers::pi && joint.upper < std::numbers::pi) {
        dJointSetHingeParam(hinge, dParamLoStop, joint.lower);
        dJointSetHingeParam(hinge, dParamHiStop, joint.upper);
        dJointSetHingeParam(hinge, dParamLoStop, joint.lower);  // refused above where it was over the old upper one
      }
      hinges_.push_back(hinge);
      motors_.push_back(make_motor(i, axis));
    }
  }

  // A motor beside the hinge: the hinge's own becomes a torque of any size where a stop is met.
  dJointID make_motor(int i, const Eigen::Vector3d& axis) {
    const dJointID motor = dJointCreateAMotor(world_, nullptr);
    dJointAttach(motor, bodies_[i + 1], bodies_[robot().links[i + 1].parent]);
    dJointSetAMotorMode(motor, dAMotorUser);
    dJointSetAMotorNumAxes(motor, 1);
    constexpr int kOfFirstBody = 1;
    dJointSetAMotorAxis(motor, 0, kOfFirstBody, axis.x(), axis.y(), axis.z());
    return motor;
  }
  void set_motor(int i) {
    const auto [target, inertia] = law_row(i);
    dJointSetAMotorParam(motors_[i], dParamFMax, inertia > 0.0 ? dInfinity : 0.0);
    dJointSetAMotorParam(motors_[i], dParamVel, target);
    dJointSetAMotorParam(motors_[i], dParamCFM, inertia > 0.0 ? scene().dt / inertia : 0.0);
  }

  void make_partner() {
    for (std::size_t i = 0; i < scene().human.capsules.size(); ++i) {
      capsules_.push_back(dCreateCapsule(space_, scene().human.capsules[i].radius, 0.1));
      tag(capsules_.back(), kPartner - static_cast<int>(i));
    }
  }

  void place_partner() {
    for (std::size_t i = 0; i < capsules_.size(); ++i) {
      const duet::HumanCapsule& human = scene().human.capsules[i];
      const duet::CapsulePose pose = duet::capsule_pose(human, partner_.joints);
      const Eigen::Vector3d p =
          partner_.present ? pose.X_WC.p : Eigen::Vector3d(3.0 * static_cast<double>(i), 0.0, 1e3);
      const Eigen::Quaterniond& R = pose.X_WC.R;
      const dQuaternion quat_wxyz = {R.w(), R.x(), R.y(), R.z()};
      dGeomCapsuleSetParams(capsules_[i], human.radius, std::max(1e-6, 2.0 * pose.half_length));
      dGeomSetPosition(capsules_[i], p.x(), p.y(), p.z());
      dGeomSetQuaternion(capsules_[i], quat_wxyz);
    }
  }

  void put(const duet::RobotState& state) {
    kinematics_.update(state.X_WB, state.q);
    std::vector<Eigen::Vector3d> v(links()), w(links());
    for (int l = 0; l < links(); ++l) {
      const duet::RobotLink& link = robot().links[l];
      const Eigen::Matrix3d& R_WL = kinematics_.R_WL(l);
      w[l] = l == 0 ? Eigen::Vector3d(R_WL * state.w_WB_B)
                    : Eigen::Vector3d(w[link.parent] + R_WL * link.axis * state.v[l - 1]);
      v[l] = l == 0 ? state.v_WB
                    : Eigen::Vector3d(v[link.parent] +
                                      w[link.parent].cross(kinematics_.p_WL(l) - kinematics_.p_WL(link.parent)));
      const Eigen::Vector3d arm = R_WL * link.com, p = kinematics_.p_WL(l) + arm, v_com = v[l] + w[l].cross(arm);
      const Eigen::Quaterniond R(R_WL);
      const dQuaternion quat_wxyz = {R.w(), R.x(), R.y(), R.z()};
      dBodySetQuaternion(bodies_[l], quat_wxyz);
      dBodySetPosition(bodies_[l], p.x(), p.y(), p.z());
      dBodySetLinearVel(bodies_[l], v_com.x(), v_com.y(), v_com.z());
      dBodySetAngularVel(bodies_[l], w[l].x(), w[l].y(), w[l].z());
      dBodySetForce(bodies_[l], 0, 0, 0);
      dBodySetTorque(bodies_[l], 0, 0, 0);
    }
  }

  void place() override {
    enter();
    forget_contacts();
    dJointGroupEmpty(group_);
    dRandSetSeed(0);  // QuickStep shuffles its rows
    put(state_);
  }
  void do_kick(const Eigen::Vector3d& dv_W) override {
    for (const dBodyID body : bodies_) {
      const Eigen::Vector3d v = eigen(dBodyGetLinearVel(body)) + dv_W;
      dBodySetLinearVel(body, v.x(), v.y(), v.z());
    }
  }

  // The space's order depends on what moved before: points are sorted before they become joints. The first geom of a
  // pair is that of a link.
  static void near(void* self, dGeomID a, dGeomID b) { static_cast<OdeOwn*>(self)->touch(a, b); }
  void touch(dGeomID a, dGeomID b) {
    if (tag_of(a) < tag_of(b)) std::swap(a, b);
    const int i = tag_of(a), j = tag_of(b);
    if (i < 0 || (j >= 0 && !may_touch(i, j))) return;
    std::array<dContactGeom, kPointsOfAPair> found;
    const int count = dCollide(a, b, kPointsOfAPair, found.data(), sizeof(dContactGeom));
    for (int k = 0; k < count; ++k) found_.push_back({i, j, count, found[k]});
  }
  void add_contacts() {
    std::stable_sort(found_.begin(), found_.end(), [](const Found& a, const Found& b) {
      return std::tie(a.link, a.other, a.geom.pos[0], a.geom.pos[1]) <
             std::tie(b.link, b.other, b.geom.pos[0], b.geom.pos[1]);
    });
    for (const Found& found : found_) add(found);
  }

  // Gazebo's ODE has max_vel and the surface layer per contact, this one per world, where they would swallow a skin:
  // they are taken off the depth of rigid contacts. A point of the ground lies at the bottom of the shape, the others
  // in the middle of the overlap.
  void add(const Found& found) {
    if (touched_.size() == feedback_.size())
      throw std::runtime_error("ode_own: more contacts than are kept in one step");
    Touched touched{.link = found.link, .p_W = eigen(found.geom.pos), .depth = found.geom.depth};
    if (found.other >= 0) touched.other = found.other;
    if (found.other <= kPartner) touched.capsule = kPartner - found.other;
    if (found.other == kGround) touched.p_W.z() += 0.5 * found.geom.depth;
    dContact contact{};
    contact.geom = found.geom;
    contact.surface.mode = dContactSoftERP | dContactSoftCFM | dContactApprox1;
    contact.surface.mu = touched.other >= 0     ? scene().friction.robot_robot
                         : touched.capsule >= 0 ? scene().friction.robot_human
                                                : scene().friction.robot_ground;
    const Softness soft = touched.capsule >= 0 ? skin(contact, touched, found.of_pair) : rigid_;
    if (touched.capsule < 0) contact.geom.depth = std::clamp(found.geom.depth - layer_, 0.0, deepest_);
    contact.surface.soft_erp = soft.erp;
    contact.surface.soft_cfm = soft.cfm;
    const dJointID joint = dJointCreateContact(world_, group_, &contact);
    dJointAttach(joint, bodies_[found.link], found.other < 0 ? nullptr : bodies_[found.other]);
    dJointSetFeedback(joint, &feedback_[touched_.size()]);
    touched_.push_back(touched);
  }

  // Spring and damper of the capsule, shared by the points of the pair; its velocity along the joint's axes.
  Softness skin(dContact& contact, const Touched& touched, int of_pair) const {
    const duet::HumanCapsule& human = scene().human.capsules[touched.capsule];
    const Eigen::Vector3d n = eigen(contact.geom.normal), t = n.unitOrthogonal();
    const Eigen::Vector3d v = duet::capsule_velocity(human, partner_, touched.p_W);
    std::copy_n(t.data(), 3, contact.fdir1);
    contact.surface.mode |= dContactFDir1 | dContactMotion1 | dContactMotion2 | dContactMotionN;
    contact.surface.motionN = v.dot(n);
    contact.surface.motion1 = v.dot(t);
    contact.surface.motion2 = v.dot(n.cross(t));
    const double K = human.skin.stiffness / of_pair, D = human.skin.damping / of_pair, h = scene().dt;
    return {.erp = h * K / (h * K + D), .cfm = 1.0 / (h * K + D)};
  }

  duet::Outcome advance(const duet::JointCommand& command) override {
    enter();
    if (!find_torques(command)) return duet::Outcome::kDiverged;
    for (int i = 0; i < n_; ++i) {
      dJointAddHingeTorque(hinges_[i], applied()[i]);
      set_motor(i);
    }
    kinematics_.update(state_.X_WB, state_.q);
    for (int l = 0; l < links() && pushes_.any(); ++l) {
      const duet::ExternalForces::Push& push = pushes_.all()[l];
      const Eigen::Vector3d p = kinematics_.X_WL(l) * push.p_L;
      dBodyAddForceAtPos(bodies_[l], push.f_W.x(), push.f_W.y(), push.f_W.z(), p.x(), p.y(), p.z());
    }
    dJointGroupEmpty(group_);
    touched_.clear();
    found_.clear();
    place_partner();
    dSpaceCollide(space_, this, near);
    add_contacts();
    if ((quick_ ? dWorldQuickStep(world_, scene().dt) : dWorldStep(world_, scene().dt)) == 0)
      throw std::runtime_error("ode_own: no memory for a step");
    for (const dBodyID body : bodies_)
      if (!(eigen(dBodyGetLinearVel(body)).norm() < duet::kDivergedSpeed)) return duet::Outcome::kDiverged;
    read();
    if (!duet::speeds_are_sane(state_)) return duet::Outcome::kDiverged;
    correct_torques();
    read_contacts();
    return duet::Outcome::kOk;
  }

  void read() {
    const dReal* quat_wxyz = dBodyGetQuaternion(bodies_[0]);
    const Eigen::Vector3d w = eigen(dBodyGetAngularVel(bodies_[0]));
    state_.X_WB.R = Eigen::Quaterniond(quat_wxyz[0], quat_wxyz[1], quat_wxyz[2], quat_wxyz[3]);
    const Eigen::Vector3d r = state_.X_WB.R * robot().links[0].com;
    state_.X_WB.p = eigen(dBodyGetPosition(bodies_[0])) - r;
    state_.v_WB = eigen(dBodyGetLinearVel(bodies_[0])) - w.cross(r);
    state_.w_WB_B = state_.X_WB.R.conjugate() * w;
    constexpr double kTurn = 2.0 * std::numbers::pi;
    for (int i = 0; i < n_; ++i) {
      const double angle = dJointGetHingeAngle(hinges_[i]);
      state_.q[i] = angle + kTurn * std::round((state_.q[i] - angle) / kTurn);
      state_.v[i] = dJointGetHingeAngleRate(hinges_[i]);
    }
  }

  void read_contacts() {
    contacts_.clear();
    for (std::size_t k = 0; k < touched_.size(); ++k) {
      const Touched& t = touched_[k];
      report(t.link, t.other, t.capsule, t.p_W, eigen(feedback_[k].f1), t.depth);
    }
    end_contacts();
  }

  // Bodies are all that outlives a step. Their setters normalise rotations, which changes last bits: these are written
  // where ODE keeps them.
  void append_to(std::vector<double>& values) const override {
    append_contacts(values);
    const auto add = [&](const dReal* from, int count) { values.insert(values.end(), from, from + count); };
    for (const dBodyID body : bodies_) {
      add(dBodyGetPosition(body), 3);
      add(dBodyGetQuaternion(body), 4);
      add(dBodyGetRotation(body), 12);
      add(dBodyGetLinearVel(body), 3);
      add(dBodyGetAngularVel(body), 3);
    }
  }
  void read_from(std::span<const double> values) override {
    enter();
    dJointGroupEmpty(group_);
    const double* from = read_contacts_from(values).data();
    for (const dBodyID body : bodies_) {
      const dQuaternion quat_wxyz = {from[3], from[4], from[5], from[6]};
      dBodySetPosition(body, from[0], from[1], from[2]);
      dBodySetQuaternion(body, quat_wxyz);
      std::copy_n(from + 3, 4, const_cast<dReal*>(dBodyGetQuaternion(body)));
      std::copy_n(from + 7, 12, const_cast<dReal*>(dBodyGetRotation(body)));
      dBodySetLinearVel(body, from[19], from[20], from[21]);
      dBodySetAngularVel(body, from[22], from[23], from[24]);
      from += 25;
    }
  }

  int n_;
  duet::Kinematics kinematics_;
  std::vector<dJointFeedback> feedback_;
  bool quick_ = false;
  Softness rigid_;
  double layer_ = 0.0, deepest_ = 0.0;  // [m]
  dThreadingImplementationID threading_ = nullptr;
  dWorldID world_ = nullptr;
  dSpaceID space_ = nullptr;
  dJointGroupID group_ = nullptr;
  std::vector<dBodyID> bodies_;
  std::vector<dJointID> hinges_, motors_;
  std::vector<dGeomID> capsules_;
  std::vector<Found> found_;
  std::vector<Touched> touched_;
};

std::string version() { return dODE_VERSION; }
std::unique_ptr<duet::Backend> make(const duet::Scene& scene) { return std::make_unique<OdeOwn>(scene); }
const duet::EngineModule kModule = {.name = "ode_own",
                                    .version = version,
                                    .make = make,
                                    .options = kOptions,
                                    .bare_step_seconds = own::bare_step_seconds<OdeOwn>};

}  // namespace

DUET_ENGINE_MODULE(kModule)
