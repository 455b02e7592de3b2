#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "duet/backends/engine_module.h"
#include "duet/backends/mujoco/mujoco_law.h"
#include "duet/backends/mujoco/mujoco_model.h"
#include "duet/backends/narrow_phase.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/require.h"

namespace duet {
namespace {

class MujocoBackend final : public Backend {
 public:
  explicit MujocoBackend(const Scene& scene)
      : Backend(scene),
        compiled_(compile_mujoco(scene)),
        m_(*compiled_.model),
        d_(*compiled_.data),
        law_(this->scene(), compiled_),
        v_before_(Eigen::VectorXd::Zero(scene.robot->dof())),
        pushes_(scene.robot->links.size()) {
    contacts_.reserve(mujoco_sizes(scene).contacts);
    order_.reserve(mujoco_sizes(scene).contacts);
  }

  [[nodiscard]] std::string_view name() const override { return "mujoco"; }
  [[nodiscard]] std::string version() const override { return mj_versionString(); }

 private:
  void do_reset() override {
    refuse_robot_overlap(scene(), state_);
    mj_resetData(&m_, &d_);
    write_state(state_, compiled_, d_);
    partner_ = {};
    pushes_.clear();
  }

  void do_set_partner(const HumanJoints& joints, const HumanJoints& velocities) override {
    if (!partner_.present) refuse_partner_overlap(scene(), state_, joints);
    partner_.set(joints, velocities);
  }

  Outcome do_step(const JointCommand& command) override {
    place_partner();
    law_.begin(state_, command);
    mj_step1(&m_, &d_);
    if (pushes_.any()) apply_pushes();
    set_skin_rows(scene(), partner_, compiled_);
    law_.accelerate();
    read_contacts();
    law_.integrate();
    partner_.advance(scene().dt);
    if (diverged()) return Outcome::kDiverged;
    check_buffers();
    v_before_ = state_.v;
    read_state(compiled_, state_);
    law_.torques(v_before_, state_.v, torques_);
    return Outcome::kOk;
  }

  void place_partner() {
    if (!partner_.present) return;
    for (size_t i = 0; i < compiled_.human_geom.size(); ++i) {
      const CapsulePose pose = capsule_pose(scene().human.capsules[i], partner_.joints);
      const int mocap = compiled_.human_mocap[i], geom = compiled_.human_geom[i];
      Eigen::Map<Eigen::Vector3d>(d_.mocap_pos + 3 * mocap) = pose.X_WC.p;
      const Eigen::Quaterniond& R = pose.X_WC.R;
      Eigen::Map<Eigen::Vector4d>(d_.mocap_quat + 4 * mocap) << R.w(), R.x(), R.y(), R.z();
      m_.geom_size[3 * geom + 1] = pose.half_length;
      m_.geom_rbound[geom] = pose.half_length + m_.geom_size[3 * geom];
    }
  }

  void do_push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) override {
    mj_kinematics(&m_, &d_);
    const int body = compiled_.link_body[link];
    pushes_.set(link, f_W, rotation(body).transpose() * (p_W - position(body)));
  }

  void do_kick(const Eigen::Vector3d& dv_W) override { Eigen::Map<Eigen::Vector3d>(d_.qvel) += dv_W; }

  void apply_pushes() {
    for (size_t link = 0; link < pushes_.all().size(); ++link) {
      const int body = compiled_.link_body[link];
      const ExternalForces::Push& push = pushes_.all()[link];
      const Eigen::Vector3d p_W = position(body) + rotation(body) * push.p_L;
      const Eigen::Vector3d arm = p_W - Eigen::Map<const Eigen::Vector3d>(d_.xipos + 3 * body);
      Eigen::Map<Eigen::Vector3d>(d_.xfrc_applied + 6 * body) = push.f_W;
      Eigen::Map<Eigen::Vector3d>(d_.xfrc_applied + 6 * body + 3) = arm.cross(push.f_W);
    }
  }

  [[nodiscard]] Eigen::Matrix3d rotation(int body) const {
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(d_.xmat + 9 * body);
  }
  [[nodiscard]] Eigen::Vector3d position(int body) const { return Eigen::Vector3d(d_.xpos + 3 * body); }

  // On a bad number MuJoCo silently starts again from its own initial state; its counters tell.
  [[nodiscard]] bool diverged() const {
    if (d_.warning[mjWARN_BADQPOS].number + d_.warning[mjWARN_BADQVEL].number + d_.warning[mjWARN_BADQACC].number > 0)
      return true;
    return Eigen::Map<const Eigen::VectorXd>(d_.qvel, m_.nv).cwiseAbs().maxCoeff() > kDivergedSpeed;
  }

  void check_buffers() const {
    if (d_.warning[mjWARN_CONTACTFULL].number + d_.warning[mjWARN_CNSTRFULL].number == 0) return;
    throw std::runtime_error(
        fmt::format("mujoco: more than {} contacts or {} constraint rows in one step", m_.nconmax, m_.njmax));
  }

  void read_contacts() {
    order_.clear();
    for (int i = 0; i < d_.ncon; ++i)
      if (d_.contact[i].efc_address >= 0) order_.push_back(i);
    std::sort(order_.begin(), order_.end(), [this](int a, int b) {
      const mjContact &x = d_.contact[a], &y = d_.contact[b];
      return std::tie(x.geom1, x.geom2, a) < std::tie(y.geom1, y.geom2, b);
    });
    contacts_.clear();
    for (const int i : order_) contacts_.push_back(contact_of(i));
  }

  // MuJoCo's force acts on the second geom's body, in a frame whose rows are the normal and two tangents.
  [[nodiscard]] Contact contact_of(int index) const {
    const mjContact& contact = d_.contact[index];
    const bool link_is_second = second_is_the_link(compiled_.geoms[contact.geom1], compiled_.geoms[contact.geom2]);
    const MujocoGeom& robot = compiled_.geoms[link_is_second ? contact.geom2 : contact.geom1];
    const MujocoGeom& other = compiled_.geoms[link_is_second ? contact.geom1 : contact.geom2];
    std::array<mjtNum, 6> wrench{};
    mj_contactForce(&m_, &d_, index, wrench.data());
    const Eigen::Vector3d f_W =
        Eigen::Map<const Eigen::Matrix3d>(contact.frame) * Eigen::Map<const Eigen::Vector3d>(wrench.data());
    return {.link = robot.index,
            .side = other.side,
            .other = other.index,
            .p_WC = Eigen::Vector3d(contact.pos),
            .f_W = link_is_second ? f_W : Eigen::Vector3d(-f_W),
            .depth = std::max(0.0, -contact.dist)};
  }

  // Between two links, the link is the one whose shape the declared pair names first.
  [[nodiscard]] bool second_is_the_link(const MujocoGeom& first, const MujocoGeom& second) const {
    if (first.side != second.side) return second.side == ContactSide::kRobot;
    const std::vector<std::pair<int, int>>& pairs = scene().robot->self_collision;
    return std::find(pairs.begin(), pairs.end(), std::pair(first.shape, second.shape)) == pairs.end();
  }

  void do_snapshot(Snapshot& snapshot) const override {
    std::vector<double>& values = snapshot.values;
    values.insert(values.end(), d_.qpos, d_.qpos + m_.nq);
    values.insert(values.end(), d_.qvel, d_.qvel + m_.nv);
    values.insert(values.end(), d_.qacc_warmstart, d_.qacc_warmstart + m_.nv);
    values.push_back(d_.time);
    pushes_.append_to(values);
    partner_.append_to(values);
  }

  void do_restore(std::span<const double> values) override {
    mj_resetData(&m_, &d_);
    const double* from = values.data();
    const auto take = [&from](int count, mjtNum* to) {
      std::copy_n(from, count, to);
      from += count;
    };
    take(m_.nq, d_.qpos);
    take(m_.nv, d_.qvel);
    take(m_.nv, d_.qacc_warmstart);
    take(1, &d_.time);
    pushes_.read_from({from, pushes_.size()});
    from += pushes_.size();
    partner_.read_from({from, MovingPartner::kValues});
  }

  MujocoModel compiled_;
  mjModel& m_;
  mjData& d_;
  MovingPartner partner_;
  MujocoLaw law_;
  Eigen::VectorXd v_before_;
  ExternalForces pushes_;
  std::vector<int> order_;
};

std::string engine_version() { return mj_versionString(); }
std::unique_ptr<Backend> make(const Scene& scene) { return std::make_unique<MujocoBackend>(scene); }

// Todorov, "Convex and analytically-invertible dynamics with contacts and constraints", 2014; MuJoCo's documentation,
// "Computation", section "Friction cones".
constexpr std::string_view kPushesApart =
    "The friction cone is convex: a contact that slides at v also pushes the bodies apart, by mu v. On a "
    "skin that adds mu v (D + dt K) to the normal force, and friction grows with it. Their ratio holds.";

constexpr std::array kDeviations = {
    EngineDeviation{.scene = "incline",
                    .quantity = "acceleration of sliding",
                    .reason = "The friction cone is convex: a contact that slides also pushes the bodies apart, the "
                              "sledge hops down the slope. Slip angle and creep hold.",
                    .bound = 0.45},
    EngineDeviation{.scene = "skin-rub", .quantity = "normal force", .reason = kPushesApart, .bound = 1.8},
    EngineDeviation{.scene = "skin-rub",
                    .quantity = "force across the slip, friction 0.6, limb slides on the diagonal",
                    .reason = kPushesApart,
                    .bound = 2.5},
    EngineDeviation{.scene = "skin-rub",
                    .quantity = "torque of the shoulder, friction 0.3, limb slides to the left",
                    .reason = kPushesApart,
                    .bound = 5.0},
    EngineDeviation{.scene = "skin-rub",
                    .quantity = "torque of the shoulder, friction 0.6, limb slides on the diagonal",
                    .reason = kPushesApart,
                    .bound = 13.5},
    EngineDeviation{.scene = "self-rub", .quantity = "normal force", .reason = kPushesApart, .bound = 0.06},
    EngineDeviation{.scene = "self-rub", .quantity = "slowing of the thigh", .reason = kPushesApart, .bound = 0.06},
};

// CPU seconds for `steps` steps from `state` under `command`: the same compiled model, law and calls of MuJoCo as the
// backend's, each followed by reading the state back. No checks, no pushes, no reports of contacts. Throws
// std::invalid_argument for steps < 1 and what making the backend throws.
double bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "mujoco_bare_step_seconds: steps is {}, expected >= 1", steps);
  MujocoModel compiled = compile_mujoco(scene);
  mjModel& m = *compiled.model;
  mjData& d = *compiled.data;
  write_state(state, compiled, d);
  MujocoLaw law(scene, compiled);
  RobotState read = state;
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    law.begin(read, command);
    mj_step1(&m, &d);
    law.accelerate();
    law.integrate();
    read_state(compiled, read);
  }
  return thread_cpu_seconds() - begin;
}

const EngineModule kModule = {.name = "mujoco",
                              .version = engine_version,
                              .make = make,
                              .options = mujoco_options(),
                              .bare_step_seconds = bare_step_seconds,
                              .step_target_us = 25.0,
                              .deviations = kDeviations};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
