// ODE behind the Backend interface. README.md says what maps to what.
#include <array>

#include "duet/backends/engine_module.h"
#include "duet/backends/ode/ode_stepper.h"
#include "duet/backends/ode/ode_world.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/require.h"

namespace duet {
namespace {

class OdeBackend final : public PhysicsBackend {
 public:
  explicit OdeBackend(const Scene& scene) : PhysicsBackend(scene), stepper_(scene, narrow_phase_.capacity()) {}
  ~OdeBackend() override { enter_ode(); }
  OdeBackend(const OdeBackend&) = delete;
  OdeBackend& operator=(const OdeBackend&) = delete;

  [[nodiscard]] std::string_view name() const override { return "ode"; }
  [[nodiscard]] std::string version() const override { return ode_version(); }

 private:
  void place() override {
    enter_ode();
    stepper_.world().place(state_);
  }

  void do_kick(const Eigen::Vector3d& dv_W) override {
    enter_ode();
    stepper_.world().kick(dv_W);
  }

  Outcome advance(const JointCommand& command) override {
    enter_ode();
    const OdeWorld& world = stepper_.world();
    const std::span<const ContactPoint> points = narrow_phase_.collide(world.rotations(), world.positions(), partner_);
    if (!stepper_.advance(command, points, pushes_.any() ? &pushes_ : nullptr, state_)) return Outcome::kDiverged;
    stepper_.torques(torques_);
    contacts_.clear();
    for (std::size_t i = 0; i < points.size(); ++i) contacts_.push_back(reported(points[i], stepper_.contact_force(i)));
    return Outcome::kOk;
  }

  void append_to(std::vector<double>& values) const override {
    const std::size_t begin = values.size();
    values.resize(begin + stepper_.world().size());
    stepper_.world().write_to(std::span(values).subspan(begin));
  }

  void read_from(std::span<const double> values) override {
    enter_ode();
    stepper_.world().read_from(values);
  }

  OdeStepper stepper_;
};

std::unique_ptr<Backend> make(const Scene& scene) { return std::make_unique<OdeBackend>(scene); }

constexpr std::string_view kPyramid =
    "Friction is a pyramid (dContactApprox0), whose first axis lies along the slip that the point would have without "
    "contact. A sprung arm's slip is another, and where both axes slip both reach their bound: sqrt(2) mu N, askew.";

constexpr std::array kDeviations = {
    EngineDeviation{
        .scene = "acceleration",
        .quantity = "error of the acceleration, relative",
        .reason = "Maximal coordinates: the new velocity obeys the joints of the old pose, so terms of products of "
                  "velocities come one step late. The trajectory converges: scenes free-flight and chain.",
        .bound = 0.5},
    EngineDeviation{
        .scene = "box-complex",
        .quantity = "order of the drift of the angular momentum",
        .reason = "The gyroscopic term is implicit and damps the tumble, and there is only so much to damp: the drift "
                  "levels off above 1 ms. Below it the order rises to one.",
        .bound = 0.85},
    EngineDeviation{.scene = "ground-bounce",
                    .quantity = "energy given back",
                    .reason = "Overlap is taken back at erp / dt times its depth, and that speed stays: the shorter "
                              "the step, the more. At 1 and 2 ms it is below 1 %.",
                    .bound = 0.05,
                    .only_at_full_effort = true},
    EngineDeviation{.scene = "skin-rub",
                    .quantity = "force across the slip, friction 0.6, limb slides on the diagonal",
                    .reason = kPyramid,
                    .bound = 31.0},
    EngineDeviation{.scene = "skin-rub",
                    .quantity = "torque of the shoulder, friction 0.6, limb slides on the diagonal",
                    .reason = kPyramid,
                    .bound = 8.0},
};

// CPU seconds for `steps` steps of OdeStepper from `state`, each with the points where the robot touches and reading
// the state back, without Backend's checks, pushes and reports. Throws std::invalid_argument for steps < 1 and what
// making the backend throws.
double bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "ode_bare_step_seconds: steps is {}, expected >= 1", steps);
  enter_ode();
  NarrowPhase narrow_phase(scene);
  OdeStepper stepper(scene, narrow_phase.capacity());
  stepper.world().place(state);
  const MovingPartner nobody;
  RobotState read = state;
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    const std::span<const ContactPoint> points =
        narrow_phase.collide(stepper.world().rotations(), stepper.world().positions(), nobody);
    stepper.advance(command, points, nullptr, read);
  }
  return thread_cpu_seconds() - begin;
}

const EngineModule kModule = {.name = "ode",
                              .version = ode_version,
                              .make = make,
                              .options = ode_option_table(),
                              .bare_step_seconds = bare_step_seconds,
                              .step_target_us = 220.0,
                              .deviations = kDeviations};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
