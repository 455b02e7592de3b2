// A controller in physics for a few seconds, told one velocity: how long it stays up, and how it goes about it.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/controllers/controller.h"
#include "duet/controllers/descriptor.h"
#include "duet/controllers/metadata.h"
#include "duet/robots/robot_model.h"

namespace duet {

struct TrialTask {
  std::string name;                  // "stand", "forward", ...
  Eigen::Vector3d told = {0, 0, 0};  // forward, lateral [m/s], yaw rate [rad/s]
  double seconds = 3.0;
  [[nodiscard]] std::string command() const;  // of the option `command`
};

// Means are over the time from kTrialSettling on, of the time that it stood.
struct TrialResult {
  bool upright = true;
  double lasted = 0.0;               // [s]
  Eigen::Vector3d went = {0, 0, 0};  // as TrialTask::told, in the heading
  double drift = 0.0;                // of the base in the plane, start to end [m]
  double height = 0.0;               // of the base [m]
  double tilt = 0.0;                 // RMS of the base's lean [rad]
  double jerk = 0.0;                 // RMS of the targets' second differences, tick by tick [rad]
  double saturated = 0.0;            // share of the joints' torques at the effort
  double speed = 0.0;                // RMS of the joints' rates [rad/s]
};
inline constexpr double kTrialSettling = 1.0;  // [s]

// The velocities that an audit tells, within the descriptor's limits and above what it answers by steps.
std::vector<TrialTask> trial_tasks(const Descriptor& descriptor);
// Others of the same kind: slower, to the other side, longer.
std::vector<TrialTask> confirming_tasks(const Descriptor& descriptor);

// The physics of the trials, and which file says so.
struct TrialPhysics {
  double dt = 0.0;  // step [s]; 0: of the profile `parity`
  std::string dt_from = "of the profile parity: neither descriptor nor network says one";
  double height = 0.0;  // of the base where it stands [m]
  std::string height_from = "its robot's card";
};

// The step of the descriptor, else of its network's file, where it fits into the network's ticks; the height of the
// descriptor, else of the robot.
TrialPhysics trial_physics(const Descriptor& descriptor, const Metadata& metadata, const RobotModel& robot);

// From the start of the trial with the profile `parity`; one robot in one engine, used again and again. Not
// thread-safe.
class TrialGround {
 public:
  // Throws std::invalid_argument and MissingError as make_backend.
  // `dt`: physics step [s]; 0: the profile's.
  TrialGround(const std::string& engine, std::shared_ptr<const RobotModel> robot, double dt = 0.0);
  // `posture`: joints in which it begins, by name; the others are neutral. Ends where it falls or diverges.
  TrialResult run(Controller& controller, const TrialTask& task, const std::map<std::string, double>& posture);

 private:
  std::shared_ptr<const RobotModel> robot_;
  std::unique_ptr<Backend> backend_;
};

// The cost of a trial: 1 and the share of the time that was lost where it fell, else a number below 1 of the errors of
// its velocity, its lean, its jerk.
double trial_cost(const TrialTask& task, const TrialResult& result);

}  // namespace duet
