// The rule of an act: how the set `act` tells a task from its neighbours where no threshold of its detector can. A rule
// looks at times and shapes (how long hands stay together and what they do meanwhile, where arms are round a trunk), so
// it is as good on recordings of 15 Hz with centimetres of noise: tracks are smoothed first (tasks/rules/evidence.h).
// Numbers were chosen on the recordings of SBU, K3HI and Kinder and on synthetic clips (docs/detectors.md, "The set
// act").
#pragma once

#include <span>
#include <string_view>

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/detector_result.h"

namespace duet {

struct RuleThreshold {
  std::string_view name;
  double value;
  std::string_view unit;
  std::string_view meaning;
};

struct ActRule {
  std::span<const RuleThreshold> thresholds;
  std::span<const DetectorFigure> figures;
  // The tracks that it looks at.
  Tracks (*tracks)(const Agent& performer, const Agent& partner);
  // Takes checked input of 50 Hz: those tracks are there, equally long and finite, and every threshold is in the map.
  // The tracks are smoothed (tasks/rules/evidence.h), once for all rules. The margins' smallest has the sign of the
  // verdict, where there is an "overall" that.
  DetectorResult (*detect)(const Agent& performer, const Agent& partner, const Thresholds& tau);
};

namespace rules {

extern const ActRule kHug, kHandshake, kHighFive, kWave, kBend, kFlyKiss, kFistBump;

}  // namespace rules
}  // namespace duet
