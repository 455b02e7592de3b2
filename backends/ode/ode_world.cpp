#include "duet/backends/ode/ode_world.h"

#include <fmt/format.h>
#include <ode/ode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "duet/backends/backend.h"

namespace duet {
namespace {

constexpr double kFullTurn = 2.0 * std::numbers::pi;
// ODE measures a hinge modulo a turn; a stop needs this much room before the angle jumps. [rad]
constexpr double kStopRoom = 0.5;
constexpr std::size_t kUsualContacts = 11;  // what a step's memory is made for
constexpr int kBodyValues = 3 + 4 + 12 + 3 + 3;

using RowMajor3x4 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

Eigen::Map<const Eigen::Vector3d> vector(const dReal* values) { return Eigen::Map<const Eigen::Vector3d>(values); }

// ODE's own storage of a body, written where its setters would round.
std::span<dReal> storage(const dReal* values, std::size_t count) { return {const_cast<dReal*>(values), count}; }

void copy(const Eigen::Vector3d& from, dReal* to) { std::copy_n(from.data(), 3, to); }

}  // namespace

void OdeWorld::Delete::operator()(dxThreadingImplementation* threading) const {
  dThreadingFreeImplementation(threading);
}
void OdeWorld::Delete::operator()(dxWorld* world) const { dWorldDestroy(world); }
void OdeWorld::Delete::operator()(dxJointGroup* group) const { dJointGroupDestroy(group); }
void OdeWorld::Delete::operator()(dJointFeedback* feedback) const { delete[] feedback; }

OdeWorld::OdeWorld(const Scene& scene, const OdeOptions& options, std::size_t contacts)
    : robot_(scene.robot),
      dt_(scene.dt),
      threading_(dThreadingAllocateSelfThreadedImplementation()),
      world_(dWorldCreate()),
      contact_joints_(dJointGroupCreate(0)),
      feedback_(new dJointFeedback[contacts]),
      capacity_(contacts),
      kinematics_(*robot_),
      R_WL_(robot_->links.size()),
      p_WL_(robot_->links.size()) {
  if (threading_ == nullptr) throw std::runtime_error("ode: no memory for a world");
  dWorldSetStepThreadingImplementation(world_.get(), dThreadingImplementationGetFunctions(threading_.get()),
                                       threading_.get());
  dWorldSetGravity(world_.get(), scene.gravity.x(), scene.gravity.y(), scene.gravity.z());
  dWorldSetERP(world_.get(), options.joint.erp);
  dWorldSetCFM(world_.get(), options.joint.cfm);
  dWorldSetAutoDisableFlag(world_.get(), 0);
  make_bodies();
  make_hinges(options);
  reserve_memory();
}

OdeWorld::~OdeWorld() = default;

void OdeWorld::make_bodies() {
  for (const RobotLink& link : robot_->links) {
    const dBodyID body = dBodyCreate(world_.get());
    bodies_.push_back(body);
    const Eigen::Matrix3d& I = link.inertia;
    dMass mass;
    dMassSetParameters(&mass, link.mass, 0.0, 0.0, 0.0, I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
    dBodySetMass(body, &mass);
    dBodySetGyroscopicMode(body, 1);
    dBodySetFiniteRotationMode(body, 1);
  }
}

// A hinge's angle is 0 in the pose in which it is made: the middle of the range, as far as ever from the jump.
void OdeWorld::make_hinges(const OdeOptions& options) {
  RobotState pose;
  pose.q = 0.5 * (robot_->lower() + robot_->upper());
  pose.v = Eigen::VectorXd::Zero(robot_->dof());
  place(pose);
  for (int i = 0; i < robot_->dof(); ++i) {
    const int link = i + 1;
    const dJointID hinge = dJointCreateHinge(world_.get(), nullptr);
    hinges_.push_back(hinge);
    middle_.push_back(pose.q[i]);
    dJointAttach(hinge, bodies_[link], bodies_[robot_->links[link].parent]);
    const Eigen::Vector3d& p = p_WL_[link];
    const Eigen::Vector3d axis = R_WL_[link] * robot_->links[link].axis;
    dJointSetHingeAnchor(hinge, p.x(), p.y(), p.z());
    dJointSetHingeAxis(hinge, axis.x(), axis.y(), axis.z());
    const double half_range = 0.5 * (robot_->joints[i].upper - robot_->joints[i].lower);
    has_stop_.push_back(half_range <= std::numbers::pi - kStopRoom);
    if (!has_stop_.back()) continue;
    dJointSetHingeParam(hinge, dParamStopERP, options.stop.erp);
    dJointSetHingeParam(hinge, dParamStopCFM, options.stop.cfm);
    dJointSetHingeParam(hinge, dParamLoStop, -half_range);
    dJointSetHingeParam(hinge, dParamHiStop, half_range);
  }
}

// ODE takes a step's memory when it first needs it: it does so now, for more rows than the robot alone has.
void OdeWorld::reserve_memory() {
  const dWorldStepReserveInfo no_more = {
      .struct_size = sizeof(dWorldStepReserveInfo), .reserve_factor = 1.0F, .reserve_minimum = 0};
  dWorldSetStepMemoryReservationPolicy(world_.get(), &no_more);
  OdeContact contact;
  contact.friction_bound = 1.0;
  for (std::size_t i = 0; i < std::min(capacity_, kUsualContacts); ++i) {
    contact.p_W.x() = static_cast<double>(i);
    add_contact(contact);
  }
  step();
  clear_contacts();
}

void OdeWorld::move_body(int link, const Eigen::Quaterniond& R_WL, const Eigen::Vector3d& p_WL) {
  const dQuaternion quat_wxyz = {R_WL.w(), R_WL.x(), R_WL.y(), R_WL.z()};
  const Eigen::Vector3d p_WCom = p_WL + R_WL * robot_->links[link].com;
  dBodySetQuaternion(bodies_[link], quat_wxyz);
  dBodySetPosition(bodies_[link], p_WCom.x(), p_WCom.y(), p_WCom.z());
}

void OdeWorld::place(const RobotState& state) {
  kinematics_.update(state.X_WB, state.q);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const int link = static_cast<int>(i);
    move_body(link, Eigen::Quaterniond(kinematics_.R_WL(link)), kinematics_.p_WL(link));
  }
  read_poses();
  clear_forces();
  clear_contacts();
  // Velocities of the links' origins, then of their centres of mass.
  std::vector<Eigen::Vector3d> v(bodies_.size()), w(bodies_.size());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const RobotLink& link = robot_->links[i];
    if (i == 0) {
      v[0] = state.v_WB;
      w[0] = kinematics_.R_WL(0) * state.w_WB_B;
    } else {
      v[i] = v[link.parent] + w[link.parent].cross(p_WL_[i] - p_WL_[link.parent]);
      w[i] = w[link.parent] + R_WL_[i] * link.axis * state.v[static_cast<Eigen::Index>(i) - 1];
    }
    const Eigen::Vector3d v_WCom = v[i] + w[i].cross(R_WL_[i] * link.com);
    dBodySetLinearVel(bodies_[i], v_WCom.x(), v_WCom.y(), v_WCom.z());
    dBodySetAngularVel(bodies_[i], w[i].x(), w[i].y(), w[i].z());
  }
}

void OdeWorld::kick(const Eigen::Vector3d& dv_W) {
  for (dxBody* body : bodies_) {
    const Eigen::Vector3d v_WCom = vector(dBodyGetLinearVel(body)) + dv_W;
    dBodySetLinearVel(body, v_WCom.x(), v_WCom.y(), v_WCom.z());
  }
}

void OdeWorld::read_poses() {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    R_WL_[i] = Eigen::Map<const RowMajor3x4>(dBodyGetRotation(bodies_[i])).leftCols<3>();
    p_WL_[i] = vector(dBodyGetPosition(bodies_[i])) - R_WL_[i] * robot_->links[i].com;
  }
}

void OdeWorld::read(RobotState& state) const {
  const dReal* quat_wxyz = dBodyGetQuaternion(bodies_[0]);
  const Eigen::Vector3d w_WB = vector(dBodyGetAngularVel(bodies_[0]));
  state.X_WB.R = Eigen::Quaterniond(quat_wxyz[0], quat_wxyz[1], quat_wxyz[2], quat_wxyz[3]);
  state.X_WB.p = p_WL_[0];
  state.v_WB = vector(dBodyGetLinearVel(bodies_[0])) - w_WB.cross(R_WL_[0] * robot_->links[0].com);
  state.w_WB_B = R_WL_[0].transpose() * w_WB;
  for (std::size_t i = 0; i < hinges_.size(); ++i) {
    double& q = state.q[static_cast<Eigen::Index>(i)];
    const double angle = middle_[i] + dJointGetHingeAngle(hinges_[i]);
    q = angle + kFullTurn * std::round((q - angle) / kFullTurn);
    state.v[static_cast<Eigen::Index>(i)] = dJointGetHingeAngleRate(hinges_[i]);
  }
}

bool OdeWorld::sane() const {
  return std::all_of(bodies_.begin(), bodies_.end(), [](const dBodyID body) {
    return vector(dBodyGetPosition(body)).allFinite() &&
           vector(dBodyGetLinearVel(body)).squaredNorm() < kDivergedSpeed * kDivergedSpeed &&
           vector(dBodyGetAngularVel(body)).squaredNorm() < kDivergedSpeed * kDivergedSpeed;
  });
}

void OdeWorld::clear_forces() {
  for (const dBodyID body : bodies_) {
    dBodySetForce(body, 0.0, 0.0, 0.0);
    dBodySetTorque(body, 0.0, 0.0, 0.0);
  }
}

void OdeWorld::add_torque(int joint, double torque) { dJointAddHingeTorque(hinges_[joint], torque); }

void OdeWorld::add_force(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_L) {
  const Eigen::Vector3d p_W = p_WL_[link] + R_WL_[link] * p_L;
  dBodyAddForceAtPos(bodies_[link], f_W.x(), f_W.y(), f_W.z(), p_W.x(), p_W.y(), p_W.z());
}

void OdeWorld::clear_contacts() {
  dJointGroupEmpty(contact_joints_.get());
  contacts_ = 0;
}

void OdeWorld::add_contact(const OdeContact& contact) {
  const dJointID joint = contact.stuck ? make_anchor(contact) : make_contact(contact);
  dJointSetFeedback(joint, &feedback_[contacts_++]);
}

dJointID OdeWorld::make_contact(const OdeContact& contact) {
  dContact c{};
  c.surface.mode = dContactApprox0 | dContactSoftERP | dContactSoftCFM | dContactFDir1 | dContactMotion1 |
                   dContactMotion2 | dContactMotionN | dContactSlip1 | dContactSlip2;
  c.surface.mu = contact.friction_bound;
  c.surface.soft_erp = contact.softness.erp;
  c.surface.soft_cfm = contact.softness.cfm;
  c.surface.slip1 = c.surface.slip2 = contact.slip;
  c.surface.motionN = contact.velocity[0];
  c.surface.motion1 = contact.velocity[1];
  c.surface.motion2 = contact.velocity[2];
  c.geom.depth = contact.depth;
  copy(contact.p_W, c.geom.pos);
  copy(contact.axes_W.col(0), c.geom.normal);
  copy(contact.axes_W.col(1), c.fdir1);
  const dJointID joint = dJointCreateContact(world_.get(), contact_joints_.get(), &c);
  dJointAttach(joint, bodies_[contact.link], contact.other < 0 ? nullptr : bodies_[contact.other]);
  return joint;
}

dJointID OdeWorld::make_anchor(const OdeContact& contact) {
  const dJointID joint = dJointCreateBall(world_.get(), contact_joints_.get());
  dJointAttach(joint, bodies_[contact.link], nullptr);
  const Eigen::Vector3d& p = contact.p_W;
  const Eigen::Vector3d out = p + contact.depth * contact.axes_W.col(0);
  dJointSetBallAnchor(joint, p.x(), p.y(), p.z());
  dJointSetBallAnchor2(joint, out.x(), out.y(), out.z());
  dJointSetBallParam(joint, dParamERP, contact.softness.erp);
  dJointSetBallParam(joint, dParamCFM, contact.softness.cfm);
  return joint;
}

void OdeWorld::step() {
  if (dWorldStep(world_.get(), dt_) == 0) throw std::runtime_error("ode: no memory for a step");
  read_poses();
}

Eigen::Vector3d OdeWorld::contact_force(std::size_t i) const { return vector(feedback_[i].f1); }

std::size_t OdeWorld::size() const { return kBodyValues * bodies_.size(); }

void OdeWorld::write_to(std::span<double> values) const {
  double* to = values.data();
  for (const dBodyID body : bodies_) {
    to = std::copy_n(dBodyGetPosition(body), 3, to);
    to = std::copy_n(dBodyGetQuaternion(body), 4, to);
    to = std::copy_n(dBodyGetRotation(body), 12, to);
    to = std::copy_n(dBodyGetLinearVel(body), 3, to);
    to = std::copy_n(dBodyGetAngularVel(body), 3, to);
  }
}

// The setter of a rotation normalises it again, which changes last bits; so it is written where ODE keeps it. ODE's
// other setters copy.
void OdeWorld::read_from(std::span<const double> values) {
  const double* from = values.data();
  for (const dBodyID body : bodies_) {
    dBodySetPosition(body, from[0], from[1], from[2]);
    std::copy_n(from + 3, 4, storage(dBodyGetQuaternion(body), 4).data());
    std::copy_n(from + 7, 12, storage(dBodyGetRotation(body), 12).data());
    dBodySetLinearVel(body, from[19], from[20], from[21]);
    dBodySetAngularVel(body, from[22], from[23], from[24]);
    from += kBodyValues;
  }
  clear_forces();
  clear_contacts();
  read_poses();
}

namespace {

// ODE ends the process where a handler of errors returns; it is C++ inside and lets exceptions pass.
[[noreturn]] void throw_error(int number, const char* format, va_list arguments) {
  std::array<char, 500> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  throw std::runtime_error(fmt::format("ode: {} (error {})", text.data(), number));
}

void say_nothing(int, const char*, va_list) {}

struct Library {
  Library() {
    if (dInitODE2(0) == 0) throw std::runtime_error("ode: the library cannot be initialised");
    if (dCheckConfiguration("ODE_double_precision") == 0)
      throw std::runtime_error("ode: the library was built with single precision, expected double");
    if (dGetErrorHandler() == nullptr) dSetErrorHandler(throw_error);
    if (dGetDebugHandler() == nullptr) dSetDebugHandler(throw_error);
    if (dGetMessageHandler() == nullptr) dSetMessageHandler(say_nothing);
  }
};

struct ThreadData {
  ThreadData() {
    if (dAllocateODEDataForThread(dAllocateMaskAll) == 0)
      throw std::runtime_error("ode: no memory for the data of a thread");
  }
  ~ThreadData() { dCleanupODEAllDataForThread(); }
  ThreadData(const ThreadData&) = delete;
  ThreadData& operator=(const ThreadData&) = delete;
};

}  // namespace

void enter_ode() {
  static const Library library;
  thread_local const ThreadData data;
}

std::string ode_version() { return dODE_VERSION; }

std::span<const EngineOption> ode_option_table() {
  static const std::vector<EngineOption> table = {
      number_option("joint_erp", 0.8, 0.0, 1.0, "share of a hinge's drift that a step removes"),
      number_option("joint_cfm", 0.0, 0.0, 1.0, "compliance of hinges [m/(N s)]"),
      number_option("stop_erp", 0.2, 0.0, 1.0, "share of what a joint has passed its stop by that a step removes"),
      number_option("stop_cfm", 1e-9, 0.0, 1.0, "compliance of joint stops [rad/(N m s)]"),
      number_option("contact_erp", 0.2, 0.0, 1.0, "share of the depth of a rigid contact that a step removes"),
      number_option("contact_cfm", 1e-8, 1e-12, 1.0, "compliance of rigid contacts and of friction [m/(N s)]"),
      choice_option("friction", {"active", "bounded"},
                    "active: contacts foreseen to stick have no bound on friction; a step that then breaks one is "
                    "repeated with all bounds. bounded: all bounds in every step"),
      integer_option("sweeps", 100, 1, 10000, "of Gauss-Seidel where the forecast of ODE's forces does not settle")};
  return table;
}

OdeOptions ode_options(const EngineOptions& options) {
  const std::span<const EngineOption> known = ode_option_table();
  check_options("ode", options, known);
  const auto softness = [&](const std::string& of) {
    return ConstraintSoftness{.erp = option_number(options, known, of + "_erp"),
                              .cfm = option_number(options, known, of + "_cfm")};
  };
  return {.joint = softness("joint"),
          .stop = softness("stop"),
          .contact = softness("contact"),
          .stick = option_choice(options, known, "friction") == "active",
          .sweeps = option_integer(options, known, "sweeps")};
}

}  // namespace duet
