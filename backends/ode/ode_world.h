// The robot in ODE: a free body per link, a hinge per joint, no shapes. For the files of this folder; ODE's types are
// only named here. Each function must run in a thread that has entered ODE (ode_world.h); not thread-safe.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/contact_solver.h"
#include "duet/backends/engine_module.h"
#include "duet/core/robot_state.h"
#include "duet/robots/kinematics.h"

namespace duet {

// The settings of ODE that a profile may change, with their defaults.

struct OdeOptions {
  ConstraintSoftness joint = {};    // of hinges
  ConstraintSoftness stop = {};     // of joint stops
  ConstraintSoftness contact = {};  // of contacts with the ground and between links
  bool stick = true;                // contacts that are foreseen to stick are given to ODE without a bound on friction
  int sweeps = 0;                   // of Gauss-Seidel, where the forecast of ODE's forces needs it
};

std::span<const EngineOption> ode_option_table();
// Throws std::invalid_argument (check_options).
OdeOptions ode_options(const EngineOptions& options);

}  // namespace duet

struct dxWorld;
struct dxBody;
struct dxJoint;
struct dxJointGroup;
struct dxThreadingImplementation;
struct dJointFeedback;

namespace duet {

// A contact for one step. The link moves relative to `other`, or to something that ODE does not know.
struct OdeContact {
  int link = 0;
  int other = -1;  // link; -1: none
  Eigen::Vector3d p_W = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes_W = Eigen::Matrix3d::Identity();  // columns: normal towards the link, two tangents
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();    // along the axes, that the link shall have [m/s]
  double depth = 0.0;                                    // [m]
  ConstraintSoftness softness = {};                      // along the normal
  double slip = 0.0;                                     // compliance along the tangents [m/(N s)]
  double friction_bound = 0.0;                           // along either tangent [N]
  // Holds the point to the ground along all axes instead, with the softness of the normal.
  bool stuck = false;
};

class OdeWorld {
 public:
  // `contacts`: the most of one step. Throws std::runtime_error with ODE's message.
  OdeWorld(const Scene& scene, const OdeOptions& options, std::size_t contacts);
  ~OdeWorld();
  OdeWorld(const OdeWorld&) = delete;
  OdeWorld& operator=(const OdeWorld&) = delete;

  void place(const RobotState& state);
  void kick(const Eigen::Vector3d& dv_W);  // adds to every body's velocity
  // Poses of all links as ODE has them after the last place(), step() or read_from().
  [[nodiscard]] std::span<const Eigen::Matrix3d> rotations() const { return R_WL_; }
  [[nodiscard]] std::span<const Eigen::Vector3d> positions() const { return p_WL_; }
  // `state.q` must be near (within half a turn): ODE measures angles modulo a turn.
  void read(RobotState& state) const;
  // False where a link moves faster than kDivergedSpeed, or is nowhere.
  [[nodiscard]] bool sane() const;

  // Inputs of the next step only.
  void clear_forces();
  [[nodiscard]] bool has_stop(int joint) const { return has_stop_[joint]; }  // that ODE can hold
  void add_torque(int joint, double torque);
  void add_force(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_L);
  void clear_contacts();
  void add_contact(const OdeContact& contact);
  // Throws std::runtime_error with ODE's message.
  void step();
  [[nodiscard]] Eigen::Vector3d contact_force(std::size_t i) const;  // on the link, in the last step [N]

  // All that a bitwise continuation needs: size() numbers, written or read back.
  [[nodiscard]] std::size_t size() const;
  void write_to(std::span<double> values) const;
  void read_from(std::span<const double> values);

 private:
  struct Delete {
    void operator()(dxThreadingImplementation* threading) const;
    void operator()(dxWorld* world) const;
    void operator()(dxJointGroup* group) const;
    void operator()(dJointFeedback* feedback) const;
  };
  void make_bodies();
  void make_hinges(const OdeOptions& options);
  void reserve_memory();
  void move_body(int link, const Eigen::Quaterniond& R_WL, const Eigen::Vector3d& p_WL);
  void read_poses();
  [[nodiscard]] dxJoint* make_contact(const OdeContact& contact);
  [[nodiscard]] dxJoint* make_anchor(const OdeContact& contact);

  std::shared_ptr<const RobotModel> robot_;
  double dt_;
  // Without one of its own a world steps through a job list that all worlds of the process share.
  std::unique_ptr<dxThreadingImplementation, Delete> threading_;
  std::unique_ptr<dxWorld, Delete> world_;
  std::unique_ptr<dxJointGroup, Delete> contact_joints_;
  std::vector<dxBody*> bodies_;   // of links
  std::vector<dxJoint*> hinges_;  // of joints
  std::vector<double> middle_;    // position of a joint where its hinge's angle is 0 [rad]
  std::vector<bool> has_stop_;    // of joints
  std::unique_ptr<dJointFeedback[], Delete> feedback_;
  std::size_t contacts_ = 0, capacity_;
  Kinematics kinematics_;
  std::vector<Eigen::Matrix3d> R_WL_;
  std::vector<Eigen::Vector3d> p_WL_;
};

// The data that ODE keeps per process and per thread. Every function of this folder that calls ODE enters it first.

// Starts ODE on the first call and gives this thread the data that ODE needs in each thread that steps a world; they
// go with the thread. ODE's errors are from then on std::runtime_error "ode: ..." (by default they end the process),
// and nothing is printed. Handlers that the program has set before are kept. Throws std::runtime_error where ODE cannot
// start.
void enter_ode();

std::string ode_version();

}  // namespace duet
