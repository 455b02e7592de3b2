// One physics engine behind one interface. Public functions check arguments once and call the private hooks;
// adapters never repeat the checks. Not thread-safe: one backend per thread. After construction nothing
// allocates in step() but what an engine's README names.
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/core/task.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/human_body.h"
#include "duet/robots/robot_model.h"

namespace duet {

// A scene is plain data: one robot on flat ground z = 0, and a human partner made of capsules. The same scene goes to
// every engine.

// ghost: the partner touches nothing (as in the supplement). solid: contacts act on the robot and are reported.
enum class PartnerMode { kNone, kGhost, kSolid };

// How PD and feed-forward of a JointCommand become torque. kImplicit: solved together with the step, stable at any gain
// and step (ImplicitLaw says how). kExplicit: kp (q* - q) - kd v + tau_ff of the state at the step's start, held to the
// effort and constant over the step, as a user of the engine who sets torques has it.
enum class TorqueLaw { kImplicit, kExplicit };

// Friction is stated per pair of bodies (docs/architecture.md, 4); the adapter finds values that give it.
struct PairFriction {
  double robot_ground = 0.8;
  double robot_human = 0.5;
  double robot_robot = 0.5;
};

// Settings of one engine by name (iterations, solver, ...), as its module lists them: EngineModule::options.
using EngineOptions = std::map<std::string, std::string>;

struct Scene {
  std::shared_ptr<const RobotModel> robot;  // shared by all episodes and threads; read-only
  HumanBody human;                          // its capsules carry the skin
  PartnerMode partner = PartnerMode::kGhost;
  PairFriction friction;
  double dt = 0.002;  // physics step [s]
  TorqueLaw law = TorqueLaw::kImplicit;
  // In W [m/s^2]. A tilted one is an incline.
  Eigen::Vector3d gravity = {0.0, 0.0, -kGravity};
  bool self_collision = true;  // the pairs of RobotModel::self_collision touch
  EngineOptions options;       // of the engine that it goes to; what is not named has the engine's default
};

// Everything that a continuation depends on, as the engine stores it. Only for the same engine, scene and binary.
struct Snapshot {
  std::vector<double> values;
};

// The 24 joints of the partner at an instant, and their velocities, as columns [m], [m/s], frame W.
using HumanJoints = Eigen::Matrix<double, 3, 24>;

// Faster than any robot: an engine whose base or joint moves at more has diverged. [m/s], [rad/s]
inline constexpr double kDivergedSpeed = 1e4;
// False also where a velocity is not a number.
bool speeds_are_sane(const RobotState& state);

class Backend {
 public:
  // Throws std::invalid_argument: no robot, dt not in (0, 0.02], a friction or skin that is negative, a gravity that is
  // not finite, a link without mass or whose inertia is not positive definite.
  explicit Backend(Scene scene);
  virtual ~Backend() = default;
  Backend(const Backend&) = delete;
  Backend& operator=(const Backend&) = delete;

  [[nodiscard]] virtual std::string_view name() const = 0;  // "mujoco", ...
  [[nodiscard]] virtual std::string version() const = 0;    // the engine's own
  [[nodiscard]] const Scene& scene() const { return scene_; }

  // Puts the robot into `state`; clears contacts, warm starts and pushes, and takes the partner away until the next
  // set_partner(): the same state gives bitwise the same continuation. Throws std::invalid_argument for wrong sizes,
  // values that are not finite and a quaternion that is not unit; in an engine also for links that overlap or are below
  // the ground by more than narrow_phase.h allows, by name.
  void reset(const RobotState& state);
  // Partner joints now; each following step moves them on at `velocities` until the next call. The first call after a
  // reset throws std::invalid_argument in an engine where the solid partner is inside the robot (narrow_phase.h).
  void set_partner(const HumanJoints& joints, const HumanJoints& velocities);
  // One physics step of scene().dt by scene().law; the explicit one reaches an engine as feed-forward without gains.
  // kDiverged is final until reset: state() stays at the last finite one. Throws std::invalid_argument for wrong sizes,
  // values that are not finite and negative gains.
  Outcome step(const JointCommand& command);

  [[nodiscard]] const RobotState& state() const { return state_; }
  // Contacts of the last step, in an order that does not depend on addresses. Valid until the next call.
  [[nodiscard]] std::span<const Contact> contacts() const { return contacts_; }
  // Torques that the joints received in the last step. [N m]
  [[nodiscard]] const Eigen::VectorXd& torques() const { return torques_; }
  [[nodiscard]] double time() const { return static_cast<double>(steps_) * scene_.dt; }  // since reset [s]

  [[nodiscard]] Snapshot snapshot() const;
  // Continues as bitwise the same run; contacts() is empty until the next step. Throws std::invalid_argument for
  // another scene's size.
  void restore(const Snapshot& snapshot);

  // Adds a force on a link for the following steps until called again for that link (with zero: no force). The force
  // keeps its direction in W and acts at the point of the link that is at p_W now. [N], frame W.
  void push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W);
  // Changes the velocity of the whole robot at once, as a shove does: its base's by `dv_W`, its joints' not. Contacts,
  // warm starts, pushes, partner and time stay. Throws std::invalid_argument for what is not finite. [m/s], frame W.
  void kick(const Eigen::Vector3d& dv_W);

 protected:
  RobotState state_;               // hooks leave it at the state after the call
  std::vector<Contact> contacts_;  // reserved by the adapter for its largest number
  Eigen::VectorXd torques_;

 private:
  virtual void do_reset() = 0;  // from state_
  virtual void do_set_partner(const HumanJoints& joints, const HumanJoints& velocities) = 0;
  virtual Outcome do_step(const JointCommand& command) = 0;  // by the implicit law
  virtual void do_push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) = 0;
  virtual void do_kick(const Eigen::Vector3d& dv_W) = 0;   // state_ has the new velocity already
  virtual void do_snapshot(Snapshot& snapshot) const = 0;  // appends its values
  virtual void do_restore(std::span<const double> values) = 0;

  // The torque of the explicit law now, as a command.
  const JointCommand& held_torque(const JointCommand& command);

  Scene scene_;
  JointCommand held_;
  RobotState last_finite_;
  long steps_ = 0;
  bool diverged_ = false;
};

}  // namespace duet
