#include <fmt/format.h>

#include <stdexcept>

#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"
#include "duet/backends/simbody/simbody_stepper.h"
#include "duet/core/require.h"

namespace duet {
namespace {

class SimbodyBackend final : public PhysicsBackend {
 public:
  explicit SimbodyBackend(const Scene& scene) : PhysicsBackend(scene), stepper_(scene, narrow_phase_.capacity()) {}

  [[nodiscard]] std::string_view name() const override { return "simbody"; }
  [[nodiscard]] std::string version() const override { return simbody_version(); }

 private:
  // Simbody's state is written anew from state_ in every step, and nothing else is kept between steps.
  void place() override {}
  void do_kick(const Eigen::Vector3d&) override {}
  void append_to(std::vector<double>&) const override {}
  void read_from(std::span<const double>) override {}

  Outcome advance(const JointCommand& command) override {
    if (!step(command) || !speeds_are_sane(state_)) return Outcome::kDiverged;
    stepper_.law().torques(stepper_.acceleration(), torques_);
    report_contacts();
    return Outcome::kOk;
  }

  bool step(const JointCommand& command) {
    try {
      return stepper_.step(state_, command, pushes_, partner_, narrow_phase_);
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("simbody: {}", error.what()));
    }
  }

  void report_contacts() {
    contacts_.clear();
    const std::span<const ContactPoint> points = narrow_phase_.points();
    for (std::size_t i = 0; i < points.size(); ++i)
      contacts_.push_back(reported(points[i], stepper_.contacts().impulse(i) / scene().dt));
  }

  SimbodyStepper stepper_;
};

std::unique_ptr<Backend> make(const Scene& scene) { return std::make_unique<SimbodyBackend>(scene); }

// CPU seconds for `steps` steps from `state` under `command`: Simbody's dynamics, the torque law, the ground's contacts
// and the state read back; no checks, pushes, partner or reports. Throws std::invalid_argument for steps < 1 and what
// making the backend throws.
double bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "simbody_bare_step_seconds: steps is {}, expected >= 1", steps);
  NarrowPhase narrow_phase(scene);
  SimbodyStepper stepper(scene, narrow_phase.capacity());
  const ExternalForces no_pushes(scene.robot->links.size());
  RobotState moving = state;
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step)
    if (!stepper.step(moving, command, no_pushes, {}, narrow_phase)) break;
  return thread_cpu_seconds() - begin;
}

const EngineModule kModule = {.name = "simbody",
                              .version = simbody_version,
                              .make = make,
                              .options = simbody_options(),
                              .bare_step_seconds = bare_step_seconds,
                              .step_target_us = 120.0};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
