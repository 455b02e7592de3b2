#include "duet/retarget/pair_schedule.h"

#include <algorithm>

namespace duet {

PairIteration pair_iteration(const PairOptions& options, int iteration) {
  const PairSchedule& schedule = options.schedule;
  const bool second = iteration >= schedule.stage1_iterations;
  const bool restarted = second && !schedule.keep_moments;
  PairIteration out;
  out.weights = options.weights;
  if (second) out.weights.con *= schedule.stage2_contact_scale;
  out.rate = second ? schedule.stage2_rate : schedule.stage1_rate;
  out.epsilon = schedule.epsilon;
  out.adam_step = iteration + 1 - (restarted ? schedule.stage1_iterations : 0);
  out.reset = restarted && iteration == schedule.stage1_iterations;
  return out;
}

int imitation_iterations(const PairOptions& options) { return std::min(8, options.lbfgs_iterations / 6); }

}  // namespace duet
