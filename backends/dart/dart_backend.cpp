#include <fmt/format.h>

#include <dart/config.hpp>
#include <exception>
#include <stdexcept>

#include "duet/backends/dart/dart_world.h"
#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/require.h"

namespace duet {
namespace {

std::string engine_version() { return DART_VERSION; }

class DartBackend final : public PhysicsBackend {
 public:
  explicit DartBackend(const Scene& scene)
      : PhysicsBackend(scene),
        world_(scene, narrow_phase_.capacity()),
        R_WL_(scene.robot->links.size()),
        p_WL_(scene.robot->links.size()) {}

  [[nodiscard]] std::string_view name() const override { return "dart"; }
  [[nodiscard]] std::string version() const override { return engine_version(); }

 private:
  void place() override { world_.write_state(state_); }
  void do_kick(const Eigen::Vector3d& dv_W) override { world_.kick(dv_W); }

  Outcome advance(const JointCommand& command) override {
    world_.read_poses(R_WL_, p_WL_);
    const std::span<const ContactPoint> points = narrow_phase_.collide(R_WL_, p_WL_, partner_);
    if (pushes_.any()) world_.apply(pushes_);
    if (!step(command, points)) return Outcome::kDiverged;
    world_.read_state(state_);
    world_.read_torques(torques_);
    contacts_.clear();
    for (std::size_t i = 0; i < points.size(); ++i) contacts_.push_back(reported(points[i], world_.contact_force(i)));
    return Outcome::kOk;
  }

  bool step(const JointCommand& command, std::span<const ContactPoint> points) {
    try {
      return world_.step(command, state_, points);
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("dart: {}", error.what()));
    }
  }

  void append_to(std::vector<double>& values) const override { world_.append_to(values); }
  void read_from(std::span<const double> values) override { world_.read_from(values); }

  DartWorld world_;
  std::vector<Eigen::Matrix3d> R_WL_;  // poses of the links at the begin of a step
  std::vector<Eigen::Vector3d> p_WL_;
};

std::unique_ptr<Backend> make(const Scene& scene) { return std::make_unique<DartBackend>(scene); }

// EngineModule::bare_step_seconds for DART: the same contacts, torque law and calls of DART as the backend's, without
// its checks, reports and pushes.
double bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "dart_bare_step_seconds: steps is {}, expected >= 1", steps);
  NarrowPhase narrow_phase(scene);
  DartWorld world(scene, narrow_phase.capacity());
  world.write_state(state);
  const MovingPartner nobody;
  std::vector<Eigen::Matrix3d> R_WL(scene.robot->links.size());
  std::vector<Eigen::Vector3d> p_WL(scene.robot->links.size());
  RobotState read = state;
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    world.read_poses(R_WL, p_WL);
    if (!world.step(command, read, narrow_phase.collide(R_WL, p_WL, nobody))) break;
    world.read_state(read);
  }
  return thread_cpu_seconds() - begin;
}

const EngineModule kModule = {.name = "dart",
                              .version = engine_version,
                              .make = make,
                              .options = dart_options(),
                              .bare_step_seconds = bare_step_seconds,
                              .step_target_us = 130.0};

}  // namespace
}  // namespace duet

DUET_ENGINE_MODULE(duet::kModule)
