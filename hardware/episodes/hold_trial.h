// Whether a robot that is held stays on its feet. The twin walks behind its guard, something happens that holds it, and
// the hold lasts: a physics engine says whether it falls. What an engine does not have - a floor that gives, a motor
// that is hot - is not in the figure.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "duet/hardware/guard/walker.h"
#include "duet/hardware/safety/safety_machine.h"

namespace duet {

struct HoldTrialSetup {
  std::string engine = "mujoco";  // behind the twin
  double forward = 0.25;          // that it walks with before it is held; 0: it stands [m/s]
  double seconds = 30.0;          // of the hold
  double noise = 1.0;             // of the sensors, as a share of the usual (noisy_twin())
};

struct HoldTrial {
  bool held = false;       // the guard held for this cause, and went on holding
  bool fell = false;       // by the robot's own rule; the trial ends there
  bool damped = false;     // the guard damped
  bool ran_again = false;  // once the cause was over and its operator asked
  double tilt = 0.0;       // largest while it was held [rad]
  double strayed = 0.0;    // largest distance from where it was when it was held, on the floor [m]
  std::string said;        // the guard's state and cause at the end
};

// The causes that hold a robot whose motors the guard itself commands. The clock that falls is left out: the twin's
// does not.
const std::vector<StopCause>& causes_of_holds();

// Throws as TwinInProcess does; std::runtime_error where the twin does not run. The same arguments give the same trial.
HoldTrial run_hold_trial(StopCause cause, const HoldTrialSetup& setup, std::unique_ptr<Walker> walker,
                         std::uint64_t seed);

}  // namespace duet
