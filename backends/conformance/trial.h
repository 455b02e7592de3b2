// The common part of the suite's scenes: the settings they run under, a timed world, and how they note what they found.
// Internal to backends/conformance.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/conformance/conformance.h"
#include "duet/robots/robot_model.h"

namespace duet::conformance {

class Trial {
 public:
  Trial(std::string engine, const Settings& settings, std::string scene, SceneRun& run);

  [[nodiscard]] const std::string& engine() const { return engine_; }
  [[nodiscard]] double dt() const { return settings_.dt; }
  // Why the engine has no solid partner; "" where it has one.
  [[nodiscard]] std::string no_partner() const { return no_partner_; }
  [[nodiscard]] bool full() const { return settings_.effort == Effort::kFull; }
  // Step sizes for what depends on them, each half of the one before; quick: dt and dt / 2.
  [[nodiscard]] std::vector<double> step_sizes() const;
  [[nodiscard]] const std::shared_ptr<const RobotModel>& robot() const { return settings_.robot; }
  [[nodiscard]] bool of_stand_in() const { return of_stand_in_; }
  // A figure that was measured once on the robot that stands in; of another robot nothing is known, and what was found
  // here takes its place until there are other engines to compare with.
  [[nodiscard]] double stored(double figure, double found) const { return of_stand_in_ ? figure : found; }
  // No partner, no self-collision, the engine's options.
  [[nodiscard]] Scene scene(std::shared_ptr<const RobotModel> robot, double dt) const;

  // Notes |value - expected| <= tolerance.
  Measurement& absolute(std::string quantity, std::string unit, double dt, double value, double expected,
                        double tolerance, std::string note);
  // Notes |value - expected| <= tolerance |expected|.
  Measurement& relative(std::string quantity, std::string unit, double dt, double value, double expected,
                        double tolerance, std::string note);
  // Notes 0 <= value <= bound.
  Measurement& at_most(std::string quantity, std::string unit, double dt, double value, double bound, std::string note);
  // Notes 0 <= value <= bound, where the bound was found on the robot that stands in; of another robot 15 % about the
  // median of the engines.
  Measurement& at_most_found(std::string quantity, std::string unit, double dt, double value, double bound,
                             std::string note);
  // Notes that the engine lacks what `quantity` asks for, and why.
  void unsupported(std::string quantity, std::string reason);
  // Notes a dot of error against cost, where error > 0.
  void dot(std::string error, std::string unit, double dt, double value, double cost);
  // Notes the observed order of convergence between consecutive step sizes, log2 of the ratio of errors, as between 0.8
  // and 1.3.
  void first_order(const std::string& quantity, const std::vector<double>& step_sizes,
                   const std::vector<double>& errors);

 private:
  Measurement& note(Measurement measurement);

  std::string engine_, no_partner_;
  const Settings& settings_;
  std::string scene_;
  SceneRun& run_;
  bool of_stand_in_;
};

// A backend whose steps are timed (CPU clock of the thread, about a microsecond a step for reading it).
class World {
 public:
  World(const Trial& trial, const Scene& scene);

  [[nodiscard]] Backend& backend() { return *backend_; }
  [[nodiscard]] const RobotState& state() const { return backend_->state(); }
  [[nodiscard]] const RobotModel& robot() const { return *backend_->scene().robot; }
  [[nodiscard]] double dt() const { return backend_->scene().dt; }
  [[nodiscard]] double time() const { return backend_->time(); }
  void reset(const RobotState& state) { backend_->reset(state); }
  // Throws std::runtime_error, with the time, where the engine diverges.
  void step(const JointCommand& command);
  void run(double seconds, const JointCommand& command);
  // CPU seconds per simulated second, over all steps so far.
  [[nodiscard]] double cost() const;
  // Sum of the forces of this side on the robot in the last step. [N], W.
  [[nodiscard]] Eigen::Vector3d force_of(ContactSide side) const;

 private:
  std::unique_ptr<Backend> backend_;
  double cpu_ = 0.0;
  long steps_ = 0;
};

int steps_in(double seconds, double dt);  // nearest

// The scenes of the suite, by what they need. Internal to backends/conformance.

class Trial;

// flight_scenes.cpp
void measure_state(Trial& trial);
void measure_acceleration(Trial& trial);
// flight_scenes.cpp
void measure_free_flight(Trial& trial);
void measure_momentum(Trial& trial);
// flight_scenes.cpp
void measure_box_simple(Trial& trial);
void measure_box_complex(Trial& trial);
// joint_scenes.cpp
void measure_pendulum(Trial& trial);
void measure_chain(Trial& trial);
// joint_scenes.cpp
void measure_armature(Trial& trial);
void measure_effort(Trial& trial);
void measure_step_response(Trial& trial);
void measure_saturation(Trial& trial);
void measure_law(Trial& trial);
void measure_joint_stop(Trial& trial);
// contact_scenes.cpp
void measure_incline(Trial& trial);
void measure_rolling_ball(Trial& trial);
// contact_scenes.cpp
void measure_skin_bounce(Trial& trial);
void measure_ground_bounce(Trial& trial);
// standing_scenes.cpp
void measure_stand(Trial& trial);
std::string lacks_ankles(const RobotModel& robot);  // two legs that end in a pitch and a roll, and soles
void measure_fall(Trial& trial);
std::string lacks_soles(const RobotModel& robot);
void measure_held_push(Trial& trial);
std::string lacks_trunk_or_ankles(const RobotModel& robot);  // a shape of the region "torso", too
// contact_scenes.cpp
void measure_self_collision(Trial& trial);
std::string lacks_hand_poses(const RobotModel& robot);  // the poses hand_before_trunk and hand_in_trunk
// two_body_scenes.cpp
void measure_skin_rub(Trial& trial);
void measure_skin_strike(Trial& trial);
void measure_skin_carry(Trial& trial);
void measure_self_rub(Trial& trial);
// standing_scenes.cpp
void measure_repeat(Trial& trial);

}  // namespace duet::conformance
