#include "duet/backends/conformance/trial.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "duet/backends/actuation.h"
#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"
#include "duet/robots/robot_cards.h"

namespace duet::conformance {

Trial::Trial(std::string engine, const Settings& settings, std::string scene, SceneRun& run)
    : engine_(std::move(engine)),
      no_partner_(engine_module(engine_).no_solid_partner),
      settings_(settings),
      scene_(std::move(scene)),
      run_(run),
      of_stand_in_(settings.robot == nullptr || settings.robot->name == default_robot()) {}

std::vector<double> Trial::step_sizes() const {
  const double dt = settings_.dt;
  if (!full()) return {dt, 0.5 * dt};
  return {2.0 * dt, dt, 0.5 * dt, 0.25 * dt};
}

Scene Trial::scene(std::shared_ptr<const RobotModel> robot, double dt) const {
  Scene scene;
  scene.robot = with_armature(std::move(robot), settings_.armature);
  scene.law = settings_.law;
  scene.partner = PartnerMode::kNone;
  scene.dt = dt;
  scene.self_collision = false;
  scene.options = settings_.options;
  return scene;
}

Measurement& Trial::note(Measurement measurement) {
  measurement.of_stand_in = of_stand_in_;
  run_.measurements.push_back(std::move(measurement));
  return run_.measurements.back();
}

Measurement& Trial::absolute(std::string quantity, std::string unit, double dt, double value, double expected,
                             double tolerance, std::string text) {
  return note({.scene = scene_,
               .quantity = std::move(quantity),
               .unit = std::move(unit),
               .dt = dt,
               .value = value,
               .expected = expected,
               .tolerance = tolerance,
               .note = std::move(text)});
}

Measurement& Trial::relative(std::string quantity, std::string unit, double dt, double value, double expected,
                             double tolerance, std::string text) {
  Measurement& measurement =
      absolute(std::move(quantity), std::move(unit), dt, value, expected, tolerance, std::move(text));
  measurement.relative = true;
  return measurement;
}

Measurement& Trial::at_most(std::string quantity, std::string unit, double dt, double value, double bound,
                            std::string text) {
  return absolute(std::move(quantity), std::move(unit), dt, value, 0.0, bound, std::move(text));
}

Measurement& Trial::at_most_found(std::string quantity, std::string unit, double dt, double value, double bound,
                                  std::string text) {
  if (of_stand_in_) return at_most(std::move(quantity), std::move(unit), dt, value, bound, std::move(text));
  Measurement& measurement =
      relative(std::move(quantity), std::move(unit), dt, value, value, 0.15, "no bound is known of this robot");
  measurement.across_engines = true;
  return measurement;
}

void Trial::unsupported(std::string quantity, std::string reason) {
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  absolute(std::move(quantity), "", settings_.dt, kNothing, kNothing, 0.0, std::move(reason)).unsupported = true;
}

void Trial::dot(std::string error, std::string unit, double dt, double value, double cost) {
  run_.error = std::move(error);
  run_.error_unit = std::move(unit);
  if (value > 0.0) run_.accuracy.push_back({dt, value, cost});
}

void Trial::first_order(const std::string& quantity, const std::vector<double>& step_sizes,
                        const std::vector<double>& errors) {
  for (std::size_t i = 1; i < errors.size(); ++i)
    absolute(quantity, "", step_sizes[i], std::log2(errors[i - 1] / errors[i]), 1.05, 0.25,
             "log2 of the error with twice the step over the error; 0.8 to 1.3 is first order");
}

World::World(const Trial& trial, const Scene& scene) : backend_(make_backend(trial.engine(), scene)) {}

void World::step(const JointCommand& command) {
  const double before = thread_cpu_seconds();
  const Outcome outcome = backend_->step(command);
  cpu_ += thread_cpu_seconds() - before;
  ++steps_;
  if (outcome != Outcome::kOk) throw std::runtime_error(fmt::format("diverged at {:.4g} s", backend_->time()));
}

void World::run(double seconds, const JointCommand& command) {
  const int steps = steps_in(seconds, dt());
  for (int i = 0; i < steps; ++i) step(command);
}

double World::cost() const { return steps_ == 0 ? 0.0 : cpu_ / (static_cast<double>(steps_) * backend_->scene().dt); }

Eigen::Vector3d World::force_of(ContactSide side) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Contact& contact : backend_->contacts())
    if (contact.side == side) sum += contact.f_W;
  return sum;
}

int steps_in(double seconds, double dt) { return static_cast<int>(std::lround(seconds / dt)); }

}  // namespace duet::conformance
