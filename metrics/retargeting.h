// The 18 retargeting metrics of supplement C.2.1. Inputs are raw tracks so that any retargeter can be scored; the last
// functions take duet's own PairedMotion, or a recording.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/metrics/readings.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

// All throw std::invalid_argument naming the argument: shapes that disagree, too few frames, a value that is not
// finite.

// (T, P, 3) each. Mean distance [m]. With kPelvis the first point of each is subtracted per frame.
double jpe(const PointTracks& robot, const PointTracks& reshaped, JpeFrame frame = JpeFrame::kWorld);

// (T, K, 3) each; N = 2K. Mean absolute difference of the N x N distance matrices [m].
double awd(const PointTracks& source_initiator, const PointTracks& source_responder, const PointTracks& new_initiator,
           const PointTracks& robot, AwdEntries entries = AwdEntries::kFull);

struct ContactCounts {
  long tp = 0, fp = 0, fn = 0, tn = 0;
  ContactCounts& operator+=(const ContactCounts& other);
};
// (T, 2, 3) each, left hand then right; truth is the source pair. threshold [m].
ContactCounts contact_counts(const PointTracks& source_initiator, const PointTracks& source_responder,
                             const PointTracks& new_initiator, const PointTracks& robot, double threshold,
                             const MetricReadings& readings = {});
struct Classification {
  double precision = 0.0, recall = 0.0, f1 = 0.0, accuracy = 0.0;
};
Classification classification(const ContactCounts& counts, ZeroDivision zero_division = ZeroDivision::kNan);

// Magnitudes (J, T) [rad].
Eigen::MatrixXd hinge_magnitudes(const Eigen::MatrixXd& q);  // |q|
// Each group of hinges (q row, axis, in order) as one rotation: the product of the hinges' rotations. Axes are in the
// frame before the group's first hinge, at q = 0; they need not be unit.
struct HingeGroup {
  std::vector<int> rows;
  std::vector<Eigen::Vector3d> axes;
};
Eigen::MatrixXd grouped_magnitudes(const Eigen::MatrixXd& q, const std::vector<HingeGroup>& groups);
Eigen::MatrixXd rotvec_magnitudes(const PointTracks& rotvecs);

double large_angle_ratio(const Eigen::MatrixXd& magnitudes, LargeAngle reading = LargeAngle::kFrameAny,
                         double limit = 0.5);
double angle_std(const Eigen::MatrixXd& magnitudes, AngleStd reading = AngleStd::kPooled, int ddof = 0);

struct Jerk {
  double mean = 0.0, std = 0.0;  // [m/s^3], pooled over frames and joints
};
Jerk jerk(const PointTracks& positions, double rate_hz, JerkScheme scheme = JerkScheme::kDiff, int ddof = 0);

// Hinges of the G1 that make one anatomical rotation (hips, shoulders, waist, wrists; the rest alone), by joint names.
std::vector<HingeGroup> hinge_groups(const RobotModel& robot);

// All 18, by catalogue name: jpe, awd, contact_{precision,recall,f1,accuracy}_{0.2,0.35,0.5}, large_angle_ratio,
// angle_std, jerk_mean, jerk_std. NaN where undefined (no contact in the source, nothing reshaped to compare with).
// Jerk is of the robot's 16 pair points.
std::map<std::string, double> retargeting_metrics(const PairedMotion& motion, const RobotModel& robot,
                                                  const MetricReadings& readings = {});
// References that an executed act is held against, over the frames that it had before its episode ended.
struct ScoringReference {
  HumanMotion partner;   // H_p as in the clip, whatever the perturbation made of it
  HumanMotion reactor;   // H_s
  PointTracks reshaped;  // empty: not known
};
// Frames of the recording that are of the act (A.4.4 changes what is before and after).
int act_frames(const Recording& recording);
// The 18 of the act that a recording executed, in the place of the retargeted motion: they then say what the engine and
// the controller cost.
std::map<std::string, double> retargeting_metrics(const Recording& recording, const ScoringReference& source,
                                                  const RobotModel& robot, const MetricReadings& readings = {});
// The metrics that a robot's motion has by itself: large_angle_ratio, angle_std, jerk_mean, jerk_std.
std::map<std::string, double> motion_metrics(const RobotMotion& motion, const RobotModel& robot,
                                             const MetricReadings& readings = {});
// The contact counts behind them per threshold, to be added over clips (micro average).
std::array<ContactCounts, 3> retargeting_contact_counts(const PairedMotion& motion, const RobotModel& robot,
                                                        const MetricReadings& readings = {});
// The same figures under every reading, the other options as given: "jpe.pelvis", "awd.cross", "awd.with_hands.full"
// (nine keypoints of A.1.1 instead of the seven of C.2.1), "contact_f1_0.35.source_frame", "large_angle_ratio.entry",
// "large_angle_ratio.grouped.entry", "angle_std.pooled", "jerk_mean.central", "jerk_mean.links.diff" (all links instead
// of the 16 pair points), ...
std::map<std::string, double> retargeting_metrics_all_readings(const PairedMotion& motion, const RobotModel& robot,
                                                               const MetricReadings& readings = {});
inline constexpr std::array<double, 3> kContactThresholds = {0.2, 0.35, 0.5};

// How well a retargeted motion keeps what the hands do with a carried object (supplement D, Fig. S3): hands of the
// robot and of the replaced person against the object's keypoints. Thread-safe.

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
