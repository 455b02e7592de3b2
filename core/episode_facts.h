// The facts of an episode, declared once: the parts that measure them return them, and the episode's row keeps them.
#pragma once

#include <limits>
#include <string>

#include "duet/core/named_values.h"

namespace duet {

// How often the controller met a number that is not finite, and what it did.
struct ControllerFaults {
  int observations = 0;  // ticks on which the state or the reference was not finite
  int actions = 0;       // ticks on which the command was not finite
  bool stopped = false;  // the safe stop was entered

  [[nodiscard]] bool any() const { return observations > 0 || actions > 0 || stopped; }
};

// Faults of policies that can fail: a process that is late or dies, a network whose numbers are not finite. A plan that
// fails is left out; the scheduler then holds the last one (F).
struct PolicyFaults {
  int late = 0;         // plans that did not come in time
  int invalid = 0;      // plans that were not finite, of the wrong size, not unit
  bool dead = false;    // it gave no plan any more
  std::string message;  // of the first fault

  [[nodiscard]] bool any() const { return late > 0 || invalid > 0 || dead; }
};

// Wall time of the policy's plans [ms]; NaN where it made none. Differs from run to run.
struct PlanTimes {
  double p50 = std::numeric_limits<double>::quiet_NaN(), p95 = p50, max = p50;
};

// One contact of one robot link with one capsule of a solid human.
struct ContactFacts {
  double begin_s = 0.0;          // from the episode's begin [s]
  double duration_s = 0.0;       // bridged gaps included [s]
  double peak_n = 0.0;           // [N]
  double impulse_ns = 0.0;       // of the force's magnitude [N s]
  double depth_m = 0.0;          // largest [m]
  double windowed_mean_n = 0.0;  // largest mean over the window of the measurement, 0.1 s [N]
};

// The findings of a detector in a motion.
struct DetectorFacts {
  bool success = false;
  NamedFlags parts;     // the printed sub-conditions by name
  NamedNumbers values;  // what was measured: each of the detector's figures that the readings have
  // Per threshold, signed: by how much it could be tightened (positive) or must be loosened (negative) with the others
  // as they are; at exactly 0 the printed comparison decides. -infinity with fewer frames than are asked for. The
  // smallest has the sign of the verdict, for a hug "overall" (the best of its three modes) has.
  NamedNumbers margins;
};

}  // namespace duet
