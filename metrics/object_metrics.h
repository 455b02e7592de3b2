// How well a retargeted motion keeps what the hands do with a carried object (supplement D, Fig. S3): hands of the
// robot and of the replaced person against the object's keypoints. Thread-safe.
#pragma once

#include <array>
#include <map>
#include <string>

#include "duet/metrics/retargeting.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

// A frame and a hand, left then right: in contact where the nearest keypoint of the object is closer than the
// threshold; the truth is the replaced person's hand. Per threshold of kContactThresholds, to be added over clips; all
// zero without an object.
std::array<ContactCounts, 3> object_contact_counts(const PairedMotion& motion, const RobotModel& robot);

// Figures by catalogue name; empty without an object.
//   object_distance_error          [m]  how far the distance is from the source's, mean over frames, hands, keypoints
//   object_distance_error.partner  [m]  the same of the partner's hands
//   object_contact_f1_{0.2,0.35,0.5}    of the counts above; NaN where there is no contact
// Throws std::invalid_argument for motions of different lengths.
std::map<std::string, double> object_metrics(const PairedMotion& motion, const RobotModel& robot,
                                             ZeroDivision zero_division = ZeroDivision::kNan);

}  // namespace duet
