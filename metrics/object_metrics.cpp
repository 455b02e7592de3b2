#include "duet/metrics/object_metrics.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/core/require.h"
#include "duet/core/skeleton.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

const std::vector<int> kHands = {kLeftHand, kRightHand};

// Hands of the robot, left then right: (T, 2, 3).
PointTracks robot_hands(const PairedMotion& motion, const RobotModel& robot) {
  const std::vector<int> frames = {robot.keypoints[robot.keypoint_index("left_hand")].frame,
                                   robot.keypoints[robot.keypoint_index("right_hand")].frame};
  return frame_tracks(robot, motion.robot, frames);
}

void check_lengths(const PairedMotion& motion) {
  const auto frames = static_cast<int>(motion.object.poses.size());
  require(frames == motion.frames() && motion.source_reactor.frames() == frames &&
              motion.source_partner.frames() == frames && motion.partner.frames() == frames,
          "object metrics: expected motions of {} frames, as the object has poses", frames);
}

double nearest(const PointTracks& hands, const PointTracks& object, int t, int hand) {
  return (object.frame(t).colwise() - hands.at(t, hand)).colwise().norm().minCoeff();
}

double distance_error(const PointTracks& before, const PointTracks& after, const PointTracks& object) {
  double sum = 0.0;
  for (int t = 0; t < object.frames(); ++t)
    for (int hand = 0; hand < 2; ++hand)
      for (int o = 0; o < object.points(); ++o)
        sum += std::abs((after.at(t, hand) - object.at(t, o)).norm() - (before.at(t, hand) - object.at(t, o)).norm());
  return sum / (2.0 * object.frames() * object.points());
}

ContactCounts counts_of(const PointTracks& before, const PointTracks& after, const PointTracks& object,
                        double threshold) {
  ContactCounts counts;
  for (int t = 0; t < object.frames(); ++t) {
    for (int hand = 0; hand < 2; ++hand) {
      const bool truth = nearest(before, object, t, hand) < threshold;
      const bool found = nearest(after, object, t, hand) < threshold;
      ++(truth ? (found ? counts.tp : counts.fn) : (found ? counts.fp : counts.tn));
    }
  }
  return counts;
}

}  // namespace

std::array<ContactCounts, 3> object_contact_counts(const PairedMotion& motion, const RobotModel& robot) {
  std::array<ContactCounts, 3> counts;
  if (motion.object.empty()) return counts;
  check_lengths(motion);
  const PointTracks object = keypoint_tracks(motion.object), hands = robot_hands(motion, robot);
  const PointTracks before = motion.source_reactor.joints.select(kHands);
  for (std::size_t i = 0; i < counts.size(); ++i) counts[i] = counts_of(before, hands, object, kContactThresholds[i]);
  return counts;
}

std::map<std::string, double> object_metrics(const PairedMotion& motion, const RobotModel& robot,
                                             ZeroDivision zero_division) {
  std::map<std::string, double> out;
  if (motion.object.empty()) return out;
  check_lengths(motion);
  const PointTracks object = keypoint_tracks(motion.object);
  out["object_distance_error"] =
      distance_error(motion.source_reactor.joints.select(kHands), robot_hands(motion, robot), object);
  out["object_distance_error.partner"] =
      distance_error(motion.source_partner.joints.select(kHands), motion.partner.joints.select(kHands), object);
  const std::array<ContactCounts, 3> counts = object_contact_counts(motion, robot);
  for (std::size_t i = 0; i < counts.size(); ++i)
    out[fmt::format("object_contact_f1_{}", kContactThresholds[i])] = classification(counts[i], zero_division).f1;
  return out;
}

}  // namespace duet
