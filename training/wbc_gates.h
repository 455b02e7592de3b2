// What WBC-Sim must pass before it ships: survival and tracking on commands of six seconds, under kicks and pushes, in
// any engine. Noise-free; each trial is deterministic from (gate, seed).
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "controllers/controller.h"
#include "training/reference_stream.h"

namespace duet {

struct WbcGate {
  std::string name;  // "walk/left_0.15"
  StreamOptions stream;
  double kick = 0.0;       // change of the velocity at 2 s and then every 3 to 6 s [m/s]
  double push = 0.0;       // force for a second, at 3 s and at 6.5 s [N]
  std::string push_track;  // "lhand", "torso": a track of the card
  double seconds = 10.0;
  double least = 1.0;  // share of trials that must survive
  double least_oracle = 1.0;
};

std::vector<WbcGate> wbc_gates();

struct GateTrial {
  bool survived = false;
  double seconds = 0.0;                              // until the fall or the end
  double root_error = 0.0, root_angle_deg = 0.0;     // of Table S4 [m], [deg]
  double joint_error = 0.0, joint_rate_error = 0.0;  // of the upper body, mean of the magnitude [rad], [rad/s]
  double hf_ratio = 0.0, dof_jerk = 0.0, root_jerk = 0.0;
  double swing_height = 0.0;  // mean over swings of the ankle's highest rise [m]
  int swings = 0;
  double on_time = 0.0;                          // share of stepping ticks x feet where the clock has them
  double closest_feet = 1.0;                     // of the ankles, over the ground [m]
  std::vector<float> left_height, right_height;  // of the ankles over their height in stance, at 50 Hz [m]
};

using ControllerMaker = std::function<std::unique_ptr<Controller>()>;

// Throws MissingError for an engine that is not there, std::invalid_argument for an unknown one.
GateTrial run_trial(const WbcGate& gate, const std::string& engine, const std::shared_ptr<const RobotModel>& robot,
                    Controller& controller, std::uint64_t seed);

struct GateResult {
  std::string gate;
  int trials = 0, survived = 0;
  GateTrial mean;  // over the trials that survived; counts are sums, closest_feet the least
};

// Trials with seeds first, first + 1, ...; the result does not depend on the number of threads.
GateResult run_gate(const WbcGate& gate, const std::string& engine, const std::shared_ptr<const RobotModel>& robot,
                    const ControllerMaker& make, int trials, int threads, std::uint64_t first = 700);

}  // namespace duet
