// Printed: any hand near the head at any time, and forward steps of that hand anywhere in the clip. Table S11 calls the
// forward motion "Phase 2", hence the readings that look only after the hand was at the head.
#include <algorithm>

#include "metrics/frame_windows.h"
#include "metrics/task_detectors.h"

namespace duet {
namespace {

// Unit vector from the performer's mean root to the partner's; zero where they coincide: no step is forward then.
Eigen::Vector3d forward_direction(const Agent& performer, const Agent& partner, FlyKissDirection reading) {
  Eigen::Vector3d direction = partner.root.rowwise().mean() - performer.root.rowwise().mean();
  if (reading == FlyKissDirection::kHorizontal) direction.z() = 0.0;
  const double length = direction.norm();
  return length > 0.0 ? Eigen::Vector3d(direction / length) : Eigen::Vector3d::Zero();
}

// First frame from which steps count; one past the last where none do.
Eigen::Index first_counted(const Eigen::ArrayXd& to_head, double hand2head, FlyKissOrder reading) {
  Eigen::Index frame = 0;
  if (reading == FlyKissOrder::kAfterClosest) {
    to_head.minCoeff(&frame);
  } else if (reading == FlyKissOrder::kAfterFirstClose) {
    while (frame < to_head.size() && to_head[frame] > hand2head) ++frame;
  }
  return frame;
}

}  // namespace

DetectorResult detect_fly_kiss(const Agent& performer, const Agent& partner, const Thresholds& tau,
                               const DetectorReadings& readings) {
  const Eigen::ArrayXd left = distances(performer.lhand, performer.head);
  const Eigen::ArrayXd right = distances(performer.rhand, performer.head);
  const bool left_active = left.minCoeff() <= right.minCoeff();
  const Eigen::ArrayXd& to_head = left_active ? left : right;
  Eigen::Matrix3Xd hand = left_active ? performer.lhand : performer.rhand;
  if (readings.fly_kiss_frame == MotionFrame::kRoot) hand -= performer.root;

  const Eigen::Index frames = hand.cols();
  const Eigen::Vector3d direction = forward_direction(performer, partner, readings.fly_kiss_dir);
  const Eigen::Index first = first_counted(to_head, tau.at("hand2head"), readings.fly_kiss_order);
  FrameMask forward(frames);  // the step that ends at this frame
  double total = 0.0;
  for (Eigen::Index t = first + 1; t < frames; ++t) {
    const double step = (hand.col(t) - hand.col(t - 1)).dot(direction);
    forward[t] = step > 0.0;
    total += std::max(step, 0.0);
  }
  const int run = longest_run(forward);
  const double d_min = to_head.minCoeff();

  DetectorResult result;
  result.frames = either(at_most(to_head, tau.at("hand2head")), forward);
  result.parts["condition_A"] = d_min <= tau.at("hand2head");
  result.parts["condition_B"] = run >= tau.at("min_forward") && total >= tau.at("forward_thresh");
  result.success = result.parts["condition_A"] && result.parts["condition_B"];
  result.values = {{"head_distance_min", d_min}, {"consecutive_forward", run}, {"total_forward_motion", total}};
  result.margins = {{"hand2head", tau.at("hand2head") - d_min},
                    {"min_forward", run - tau.at("min_forward")},
                    {"forward_thresh", total - tau.at("forward_thresh")}};
  return result;
}

}  // namespace duet
