#include <fmt/format.h>

#include <stdexcept>

#include "duet/backends/bullet/bullet_world.h"
#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/require.h"

namespace duet {
namespace {

std::string engine_version() { return fmt::format("{}.{}", btGetVersion() / 100, btGetVersion() % 100); }

class BulletBackend final : public PhysicsBackend {
 public:
  explicit BulletBackend(const Scene& scene) : PhysicsBackend(scene), world_(this->scene(), narrow_phase_.capacity()) {
    world_.articulation().write(state_);
  }

  [[nodiscard]] std::string_view name() const override { return "bullet"; }
  [[nodiscard]] std::string version() const override { return engine_version(); }

 private:
  void place() override { world_.articulation().write(state_); }
  void do_kick(const Eigen::Vector3d& dv_W) override { world_.articulation().kick(dv_W); }

  Outcome advance(const JointCommand& command) override {
    if (!world_.begin(state_, command)) return Outcome::kDiverged;
    const std::span<const ContactPoint> points = collide();
    world_.step(points, &pushes_, state_, torques_);
    if (!speeds_are_sane(state_)) return Outcome::kDiverged;
    contacts_.clear();
    for (std::size_t i = 0; i < points.size(); ++i)
      contacts_.push_back(reported(points[i], world_.rows().contact_force(i)));
    return Outcome::kOk;
  }

  std::span<const ContactPoint> collide() {
    try {
      return narrow_phase_.collide(world_.kinematics(), partner_);
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(fmt::format("bullet: {}", error.what()));
    }
  }

  void append_to(std::vector<double>& values) const override { world_.articulation().append_to(values); }
  void read_from(std::span<const double> values) override { world_.articulation().read_from(values); }

  BulletWorld world_;
};

std::unique_ptr<Backend> make(const Scene& scene) { return std::make_unique<BulletBackend>(scene); }

// CPU seconds for `steps` steps of BulletWorld from `state`, with the same contacts and the state read back: no checks,
// no pushes, no reports. Throws std::invalid_argument for steps < 1.
double bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "bullet_bare_step_seconds: steps is {}, expected >= 1", steps);
  NarrowPhase narrow_phase(scene);
  BulletWorld world(scene, narrow_phase.capacity());
  world.articulation().write(state);
  RobotState read = state;
  Eigen::VectorXd torques = Eigen::VectorXd::Zero(scene.robot->dof());
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    if (!world.begin(read, command)) break;
    world.step(narrow_phase.collide(world.kinematics(), {}), nullptr, read, torques);
  }
  return thread_cpu_seconds() - begin;
}

const EngineModule kModule = {.name = "bullet",
                              .version = engine_version,
                              .make = make,
                              .options = bullet_options(),
                              .bare_step_seconds = bare_step_seconds,
                              .step_target_us = 80.0};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
