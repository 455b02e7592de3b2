// Whether a robot behind its guard gets to a place. The twin stands, is told a place and a heading, and walks there by
// the law that a robot's planner uses; sensors are as noisy as a robot's, the body is an engine's.
#pragma once

#include <memory>
#include <string>

#include "duet/hardware/guard/walker.h"

namespace duet {

struct WalkGoal {
  double distance = 1.0;   // [m]
  double direction = 0.0;  // of the place as the robot sees it at the begin; to the left above 0 [rad]
  double heading = 0.0;    // to be turned to, from the one at the begin [rad]
};
// Any direction, any heading, a distance from `nearest` to `furthest`: uniform.
WalkGoal random_goal(double nearest, double furthest, std::uint64_t seed);

struct WalkTrialSetup {
  std::string engine = "mujoco";  // behind the twin
  double noise = 1.0;             // of the sensors, as a share of the usual (noisy_twin())
  double most_seconds = 60.0;     // from when it is told
};

inline constexpr double kReachedPlace = 0.15;    // [m]
inline constexpr double kReachedHeading = 0.15;  // [rad]

struct WalkTrial {
  double off = 0.0;                 // of the place at the end, in the plane, by the engine [m]
  double turned_off = 0.0;          // of the heading at the end [rad]
  double beyond = 0.0;              // furthest past the place, along the way from the begin; below 0: never so far [m]
  double seconds = 0.0;             // until it had stood for 2 s
  bool stands = false;              // it came to rest in time
  bool held = false, fell = false;  // the guard held or damped; by the robot's own rule
  std::string said = {};            // the guard's state and cause when it no longer ran

  [[nodiscard]] bool reached() const {
    return stands && !held && !fell && off <= kReachedPlace && turned_off <= kReachedHeading;
  }
};

// Throws as TwinInProcess does; std::runtime_error where the twin does not run. The same arguments give the same trial.
WalkTrial run_walk_trial(const WalkGoal& goal, const WalkTrialSetup& setup, std::unique_ptr<Walker> walker,
                         std::uint64_t seed);

}  // namespace duet
