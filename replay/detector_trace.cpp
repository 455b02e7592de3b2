#include "duet/replay/detector_trace.h"

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "duet/metrics/detector_catalogue.h"

namespace duet {
namespace {

// The tracks up to a frame; those that are empty stay so.
Agent first_frames(const Agent& agent, Eigen::Index frames) {
  Agent part;
  for (Eigen::Matrix3Xd Agent::*track :
       {&Agent::lhand, &Agent::rhand, &Agent::head, &Agent::root, &Agent::torso, &Agent::lshoulder, &Agent::rshoulder})
    part.*track = (agent.*track).leftCols(std::min(frames, (agent.*track).cols()));
  return part;
}

bool is_finite(const Recording& recording) {
  for (const RobotState& state : recording.robot)
    if (!state.q.allFinite() || !state.X_WB.p.allFinite() || !state.X_WB.R.coeffs().allFinite()) return false;
  return true;
}

std::string unit_of(Task task, const std::string& name, ThresholdSet set) {
  try {
    return std::string(threshold_unit(task, name, set));
  } catch (const std::invalid_argument&) {
    return "";  // a margin over several thresholds ("overall")
  }
}

void name_margins(const DetectorResult& result, Task task, DetectorTrace& trace) {
  const Thresholds tau = thresholds(task, trace.set);
  for (const auto& [name, margin] : result.margins) {
    trace.names.push_back(name);
    const auto threshold = tau.find(name);
    trace.thresholds.push_back(threshold == tau.end() ? 1.0 : threshold->second);
    trace.units.push_back(unit_of(task, name, trace.set));
  }
}

void add_margins(const DetectorResult& result, Eigen::Index sample, DetectorTrace& trace) {
  trace.success.push_back(result.success);
  for (std::size_t k = 0; k < trace.names.size(); ++k) {
    const auto found = result.margins.find(trace.names[k]);
    const double margin = found == result.margins.end() ? NAN : found->second;
    trace.margins(sample, static_cast<Eigen::Index>(k)) = std::isfinite(margin) ? margin : NAN;
  }
}

}  // namespace

DetectorTrace detector_trace(const Recording& recording, const RobotModel& robot, DetectorVersion version,
                             ThresholdSet set, const DetectorReadings& readings, int stride) {
  require(recording.task.has_value(), "detector trace: expected a recording of a task, found one of none");
  DetectorTrace trace{.version = version,
                      .set = set,
                      .evidence = {},
                      .names = {},
                      .thresholds = {},
                      .units = {},
                      .frames = {},
                      .success = {},
                      .margins = {}};
  if (recording.partner.empty() || recording.frames() == 0 || !is_finite(recording)) return trace;
  const Agent human = human_agent(recording.partner), machine = robot_agent(robot, recording.robot);
  const DetectorResult whole = detect(*recording.task, human, machine, version, set, readings);
  trace.evidence = whole.frames;
  name_margins(whole, *recording.task, trace);
  for (int t = stride - 1; t < recording.frames() - 1; t += stride) trace.frames.push_back(t);
  trace.frames.push_back(recording.frames() - 1);
  trace.margins.resize(static_cast<Eigen::Index>(trace.frames.size()), static_cast<Eigen::Index>(trace.names.size()));
  for (std::size_t i = 0; i + 1 < trace.frames.size(); ++i)
    add_margins(detect(*recording.task, first_frames(human, trace.frames[i] + 1),
                       first_frames(machine, trace.frames[i] + 1), version, set, readings),
                static_cast<Eigen::Index>(i), trace);
  add_margins(whole, static_cast<Eigen::Index>(trace.frames.size()) - 1, trace);
  return trace;
}

}  // namespace duet
