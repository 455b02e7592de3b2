// Simbody in its own world: its contact tracker, Hunt and Crossley's compliant contact with Stribeck's friction, its
// joint stops and its semi-explicit Euler, set up as Gazebo classic does.
#include <cmath>

#include "own_world.h"
#include "simbody_world.h"

namespace {

// Sources: the defaults of SDF 1.6's <simbody>, which Gazebo classic hands to Simbody, and the comments of its
// SimbodyPhysics.cc. Gazebo's Euler is controlled by its error; this one steps at min_step_size, so what is stiffer
// than that bears is softer: with SDF's dissipation the G1 buzzes on its feet at 0.1 ms, not at 0.05.
const std::vector<duet::EngineOption> kOptions = {
    duet::number_option("inner_step", 1e-4, 1e-6, 0.02, "longest step of the integrator [s] (SDF: min_step_size)"),
    duet::number_option("stiffness", 1e8, 1e3, 1e12, "plane strain modulus of a surface [Pa] (SDF: contact/stiffness)"),
    duet::number_option("dissipation", 10.0, 0.0, 1e6, "of a surface [s/m] (SimbodyPhysics.cc; SDF: 100)"),
    duet::number_option("transition_velocity", 0.01, 1e-6, 10.0,
                        "slip from which friction is whole [m/s] (SDF: max_transient_velocity)"),
    duet::number_option("stop_stiffness", 1e4, 0.0, 1e12, "of a joint's stop [N m/rad] (SDF: 1e8 shakes a wrist)"),
    duet::number_option("stop_dissipation", 0.1, 0.0, 1e6, "of a joint's stop [s/rad] (SDF: 1 shakes a wrist)")};

int inner_steps(const duet::Scene& scene) {
  return static_cast<int>(std::ceil(scene.dt / duet::option_number(scene.options, kOptions, "inner_step") - 1e-9));
}

own::SimbodySettings settings_of(const duet::Scene& scene) {
  const auto number = [&](const char* name) { return duet::option_number(scene.options, kOptions, name); };
  own::SimbodySettings settings;
  settings.gravity = scene.gravity;
  settings.friction_ground = scene.friction.robot_ground;
  // More than half of the ground's, or no value of the ground's own would give the pair's.
  settings.friction_robot = std::max(scene.friction.robot_robot, 0.6 * scene.friction.robot_ground);
  settings.stiffness = number("stiffness");
  settings.dissipation = number("dissipation");
  settings.transition_velocity = number("transition_velocity");
  settings.stop_stiffness = number("stop_stiffness");
  settings.stop_dissipation = number("stop_dissipation");
  settings.inner_step = scene.dt / inner_steps(scene);
  settings.self_collision = scene.self_collision;
  return settings;
}

class SimbodyOwn final : public own::OwnWorld {
 public:
  explicit SimbodyOwn(const duet::Scene& scene)
      : OwnWorld(scene, settings_of(scene).inner_step),
        world_(*scene.robot, settings_of(scene),
               [this](const duet::RobotState& state, const Contacts& contacts) -> const Eigen::VectorXd& {
                 take(contacts);
                 if (!find_torques(state, *command_))
                   throw std::runtime_error("simbody_own: the torque law has diverged");
                 return applied();
               }),
        inner_steps_(inner_steps(scene)),
        pushed_(links()) {}

  [[nodiscard]] std::string_view name() const override { return "simbody_own"; }
  [[nodiscard]] std::string version() const override { return own::simbody_version(); }

 private:
  using Contacts = std::vector<own::SurfaceContact>;

  // A step is a function of state_, pushes and command: nothing is kept.
  void place() override {}
  void do_kick(const Eigen::Vector3d&) override {}
  void append_to(std::vector<double>&) const override {}
  void read_from(std::span<const double>) override {}

  duet::Outcome advance(const duet::JointCommand& command) override {
    command_ = &command;
    for (int link = 0; link < links(); ++link) pushed_[link] = {pushes_.all()[link].f_W, pushes_.all()[link].p_L};
    if (!world_.advance(state_, inner_steps_, pushed_)) return duet::Outcome::kDiverged;
    if (!duet::speeds_are_sane(state_)) return duet::Outcome::kDiverged;
    take(world_.contacts());
    end_contacts();
    return duet::Outcome::kOk;
  }

  void take(const Contacts& contacts) {
    contacts_.clear();
    for (const own::SurfaceContact& contact : contacts)
      report(contact.link, contact.other, -1, contact.p_W, contact.f_W, contact.depth);
  }

  own::SimbodyWorld world_;
  const duet::JointCommand* command_ = nullptr;  // of the step
  int inner_steps_;
  own::LinkForces pushed_;
};

std::unique_ptr<duet::Backend> make(const duet::Scene& scene) { return std::make_unique<SimbodyOwn>(scene); }
const duet::EngineModule kModule = {
    .name = "simbody_own",
    .version = own::simbody_version,
    .make = make,
    .options = kOptions,
    .bare_step_seconds = own::bare_step_seconds<SimbodyOwn>,
    .no_solid_partner = "its contact is Hunt and Crossley's, which has no stiffness and damping of a pair"};

}  // namespace

DUET_ENGINE_MODULE(kModule)
