// The angle of the head over the root from the vertical. With reading `forward` only frames count at which the head
// leans towards the partner (or to the performer's front, from the line of shoulders).
#include <cmath>

#include "metrics/frame_windows.h"
#include "metrics/task_detectors.h"

namespace duet {
namespace {

// atan2 instead of an arc cosine: exact for small angles; 0 where head and root coincide.
Eigen::ArrayXd bend_angles(const Agent& performer) {
  Eigen::ArrayXd angles(performer.head.cols());
  for (Eigen::Index t = 0; t < angles.size(); ++t) {
    const Eigen::Vector3d v = performer.head.col(t) - performer.root.col(t);
    angles[t] = std::atan2(v.head<2>().norm(), v.z());
  }
  return angles;
}

FrameMask leaning_forward(const Agent& performer, const Agent& partner) {
  FrameMask forward(performer.head.cols());
  for (Eigen::Index t = 0; t < performer.head.cols(); ++t) {
    const Eigen::Vector3d lean = performer.head.col(t) - performer.root.col(t);
    Eigen::Vector3d front;
    if (partner.root.cols() > 0) {
      front = partner.root.col(t) - performer.root.col(t);
    } else {
      const Eigen::Vector3d to_left = performer.lshoulder.col(t) - performer.rshoulder.col(t);
      front = to_left.cross(Eigen::Vector3d::UnitZ());
    }
    forward[t] = lean.head<2>().dot(front.head<2>()) > 0.0;
  }
  return forward;
}

}  // namespace

DetectorResult detect_bend(const Agent& performer, const Agent& partner, const Thresholds& tau,
                           const DetectorReadings& readings) {
  const Eigen::ArrayXd angle = bend_angles(performer);
  const FrameMask counted = readings.bend_direction == BendDirection::kForward ? leaning_forward(performer, partner)
                                                                               : FrameMask(angle.size(), true);
  const bool consecutive = readings.bend_frames == BendFrames::kConsecutive;

  DetectorResult result;
  result.frames = both(at_least(angle, tau.at("min_angle")), counted);
  const int frames = consecutive ? longest_run(result.frames) : count_frames(result.frames);
  result.parts["angle_condition"] = count_frames(result.frames) > 0;
  result.parts["stability_condition"] = frames >= tau.at("min_frames");
  result.success = result.parts["angle_condition"] && result.parts["stability_condition"];

  double max_angle = 0.0;
  for (Eigen::Index t = 0; t < angle.size(); ++t)
    if (counted[t]) max_angle = std::max(max_angle, angle[t]);
  result.values = {{"max_angle", max_angle}, {"frames_above", frames}};

  const int k = frames_needed(tau.at("min_frames"));
  result.margins = {{"min_angle", consecutive ? run_slack_above(tau.at("min_angle"), angle, k, counted)
                                              : count_slack_above(tau.at("min_angle"), angle, k, counted)},
                    {"min_frames", frames - tau.at("min_frames")}};
  return result;
}

}  // namespace duet
