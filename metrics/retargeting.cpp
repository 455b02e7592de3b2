#include "duet/metrics/retargeting.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

// Everything that the metrics look at, from one pass of forward kinematics. The initiator is H_p: in the source as in
// the clip, afterwards as adapted. The responder is H_s in the source and the robot afterwards.
struct ScoredTracks {
  PointTracks robot_pairs;                                           // (T, 16, 3)
  PointTracks source_initiator, source_responder, initiator, robot;  // (T, K, 3) keypoints, hands included
  std::vector<int> awd_points;                                       // keypoints of AWD: without hands
  std::vector<int> hands;                                            // left, right
};

// The motion that is scored, wherever it comes from.
struct ScoredMotion {
  ScoredMotion(const PairedMotion& motion)  // NOLINT(google-explicit-constructor): the same parts
      : robot(motion.robot),
        partner(motion.partner.joints),
        source_partner(motion.source_partner.joints),
        source_reactor(motion.source_reactor.joints),
        reshaped(motion.reshaped) {}
  ScoredMotion(const RobotMotion& executed, const PointTracks& person, const ScoringReference& source)
      : robot(executed),
        partner(person),
        source_partner(source.partner.joints),
        source_reactor(source.reactor.joints),
        reshaped(source.reshaped) {}

  const RobotMotion& robot;
  const PointTracks &partner, &source_partner, &source_reactor, &reshaped;
};

void check_frames(const ScoredMotion& motion, const RobotModel& robot) {
  const auto check = [&](int frames, const char* name) {
    require(frames == motion.robot.frames(), "retargeting metrics: {} has {} frames, but robot has {}", name, frames,
            motion.robot.frames());
  };
  require(motion.robot.frames() > 0, "retargeting metrics: the paired motion is empty");
  check(static_cast<int>(motion.robot.q.cols()), "robot.q");
  check(motion.partner.frames(), "partner");
  check(motion.source_partner.frames(), "source_partner");
  check(motion.source_reactor.frames(), "source_reactor");
  if (!motion.reshaped.empty()) check(motion.reshaped.frames(), "reshaped");
  require(motion.robot.joint_names.empty() || motion.robot.joint_names == robot.joint_names(),
          "retargeting metrics: the joints of the motion are not those of {} in its order", robot.name);
}

ScoredTracks scored_tracks(const ScoredMotion& motion, const RobotModel& robot) {
  check_frames(motion, robot);
  const int pairs = static_cast<int>(robot.pairs.size());
  std::vector<int> frames, pair_points, robot_points, human_points;
  ScoredTracks tracks;
  for (const RetargetPair& pair : robot.pairs) {
    pair_points.push_back(static_cast<int>(frames.size()));
    frames.push_back(pair.frame);
  }
  for (size_t k = 0; k < robot.keypoints.size(); ++k) {
    robot_points.push_back(pairs + static_cast<int>(k));
    frames.push_back(robot.keypoints[k].frame);
    human_points.push_back(robot.keypoints[k].smpl);
    if (const int smpl = robot.keypoints[k].smpl; smpl != kLeftHand && smpl != kRightHand)
      tracks.awd_points.push_back(static_cast<int>(k));
  }
  tracks.hands = {robot.keypoint_index("left_hand"), robot.keypoint_index("right_hand")};
  const PointTracks points = frame_tracks(robot, motion.robot, frames);
  tracks.robot_pairs = points.select(pair_points);
  tracks.robot = points.select(robot_points);
  tracks.source_initiator = motion.source_partner.select(human_points);
  tracks.source_responder = motion.source_reactor.select(human_points);
  tracks.initiator = motion.partner.select(human_points);
  return tracks;
}

// Motions of other retargeters say nothing of a reshaped person: there is nothing to be in error against.
double jpe_of(const ScoredTracks& tracks, const ScoredMotion& motion, JpeFrame frame) {
  return motion.reshaped.empty() ? std::numeric_limits<double>::quiet_NaN()
                                 : jpe(tracks.robot_pairs, motion.reshaped, frame);
}

double awd_of(const ScoredTracks& tracks, const std::vector<int>& points, AwdEntries entries) {
  return awd(tracks.source_initiator.select(points), tracks.source_responder.select(points),
             tracks.initiator.select(points), tracks.robot.select(points), entries);
}

std::array<ContactCounts, 3> contact_counts_of(const ScoredTracks& tracks, const MetricReadings& readings) {
  const PointTracks hands[] = {tracks.source_initiator.select(tracks.hands),
                               tracks.source_responder.select(tracks.hands), tracks.initiator.select(tracks.hands),
                               tracks.robot.select(tracks.hands)};
  std::array<ContactCounts, 3> counts;
  for (size_t i = 0; i < counts.size(); ++i)
    counts[i] = contact_counts(hands[0], hands[1], hands[2], hands[3], kContactThresholds[i], readings);
  return counts;
}

void add_contacts(const ScoredTracks& tracks, const MetricReadings& readings, const std::string& suffix,
                  std::map<std::string, double>& out) {
  const std::array<ContactCounts, 3> counts = contact_counts_of(tracks, readings);
  for (size_t i = 0; i < counts.size(); ++i) {
    const Classification c = classification(counts[i], readings.zero_division);
    const std::string ending = fmt::format("_{}{}", kContactThresholds[i], suffix);
    out["contact_precision" + ending] = c.precision;
    out["contact_recall" + ending] = c.recall;
    out["contact_f1" + ending] = c.f1;
    out["contact_accuracy" + ending] = c.accuracy;
  }
}

// Every link's origin: the other plausible choice of "3D joint positions" for jerk.
PointTracks link_tracks(const RobotModel& robot, const RobotMotion& motion) {
  PointTracks tracks(motion.frames(), static_cast<int>(robot.links.size()));
  Kinematics kinematics(robot);
  for (int t = 0; t < motion.frames(); ++t) {
    kinematics.update(motion.root[t], motion.q.col(t));
    for (size_t i = 0; i < robot.links.size(); ++i)
      tracks.at(t, static_cast<int>(i)) = kinematics.p_WL(static_cast<int>(i));
  }
  return tracks;
}

// The text names of a reading option with the readings set to each in turn.
template <typename Action>
void for_each_reading(const MetricReadings& given, const std::string& option, Action action) {
  for (const std::string& value : reading_values(option)) {
    Readings readings;
    readings.metrics = given;
    set_reading(readings, option, value);
    action(value, readings.metrics);
  }
}

void add_angle_readings(const Eigen::MatrixXd& magnitudes, const std::string& kind, const MetricReadings& given,
                        std::map<std::string, double>& out) {
  for_each_reading(given, "metrics.large_angle", [&](const std::string& name, const MetricReadings& r) {
    out["large_angle_ratio." + kind + name] = large_angle_ratio(magnitudes, r.large_angle);
  });
  for_each_reading(given, "metrics.angle_std", [&](const std::string& name, const MetricReadings& r) {
    out["angle_std." + kind + name] = angle_std(magnitudes, r.angle_std, r.ddof);
  });
}

void add_jerk(const PointTracks& points, double rate_hz, const std::string& suffix, const MetricReadings& readings,
              std::map<std::string, double>& out) {
  const Jerk j = jerk(points, rate_hz, readings.jerk_scheme, readings.ddof);
  out["jerk_mean" + suffix] = j.mean;
  out["jerk_std" + suffix] = j.std;
}

std::map<std::string, double> metrics_of(const ScoredMotion& motion, const RobotModel& robot,
                                         const MetricReadings& readings) {
  const ScoredTracks tracks = scored_tracks(motion, robot);
  const Eigen::MatrixXd magnitudes = hinge_magnitudes(motion.robot.q);
  std::map<std::string, double> out;
  out["jpe"] = jpe_of(tracks, motion, readings.jpe_frame);
  out["awd"] = awd_of(tracks, tracks.awd_points, readings.awd_entries);
  add_contacts(tracks, readings, "", out);
  out["large_angle_ratio"] = large_angle_ratio(magnitudes, readings.large_angle);
  out["angle_std"] = angle_std(magnitudes, readings.angle_std, readings.ddof);
  add_jerk(tracks.robot_pairs, motion.robot.rate_hz, "", readings, out);
  return out;
}

int act_begin(const Recording& recording) { return std::min(recording.phases.act_begin, recording.frames()); }

}  // namespace

std::map<std::string, double> retargeting_metrics(const PairedMotion& motion, const RobotModel& robot,
                                                  const MetricReadings& readings) {
  return metrics_of(motion, robot, readings);
}

int act_frames(const Recording& recording) {
  return std::min(recording.phases.act_end, recording.frames()) - act_begin(recording);
}

std::map<std::string, double> retargeting_metrics(const Recording& recording, const ScoringReference& source,
                                                  const RobotModel& robot, const MetricReadings& readings) {
  const int begin = act_begin(recording), frames = act_frames(recording);
  RobotMotion executed;
  executed.joint_names = robot.joint_names();
  executed.q.resize(robot.dof(), frames);
  for (int t = 0; t < frames; ++t) {
    executed.root.push_back(recording.robot[begin + t].X_WB);
    executed.q.col(t) = recording.robot[begin + t].q;
  }
  const PointTracks person = recording.partner.slice(begin, begin + frames);
  return metrics_of({executed, person, source}, robot, readings);
}

std::map<std::string, double> motion_metrics(const RobotMotion& motion, const RobotModel& robot,
                                             const MetricReadings& readings) {
  std::vector<int> pairs;
  for (const RetargetPair& pair : robot.pairs) pairs.push_back(pair.frame);
  const Eigen::MatrixXd magnitudes = hinge_magnitudes(motion.q);
  std::map<std::string, double> out;
  out["large_angle_ratio"] = large_angle_ratio(magnitudes, readings.large_angle);
  out["angle_std"] = angle_std(magnitudes, readings.angle_std, readings.ddof);
  add_jerk(frame_tracks(robot, motion, pairs), motion.rate_hz, "", readings, out);
  return out;
}

std::array<ContactCounts, 3> retargeting_contact_counts(const PairedMotion& motion, const RobotModel& robot,
                                                        const MetricReadings& readings) {
  return contact_counts_of(scored_tracks(motion, robot), readings);
}

std::map<std::string, double> retargeting_metrics_all_readings(const PairedMotion& motion, const RobotModel& robot,
                                                               const MetricReadings& readings) {
  const ScoredTracks tracks = scored_tracks(motion, robot);
  const double rate_hz = motion.robot.rate_hz;
  std::vector<int> all_keypoints(robot.keypoints.size());
  for (size_t k = 0; k < all_keypoints.size(); ++k) all_keypoints[k] = static_cast<int>(k);

  std::map<std::string, double> out;
  for_each_reading(readings, "metrics.jpe_frame", [&](const std::string& name, const MetricReadings& r) {
    out["jpe." + name] = jpe_of(tracks, motion, r.jpe_frame);
  });
  for_each_reading(readings, "metrics.awd_entries", [&](const std::string& name, const MetricReadings& r) {
    out["awd." + name] = awd_of(tracks, tracks.awd_points, r.awd_entries);
    out["awd.with_hands." + name] = awd_of(tracks, all_keypoints, r.awd_entries);
  });
  for_each_reading(readings, "metrics.matching",
                   [&](const std::string& name, const MetricReadings& r) { add_contacts(tracks, r, "." + name, out); });
  add_angle_readings(hinge_magnitudes(motion.robot.q), "", readings, out);
  add_angle_readings(grouped_magnitudes(motion.robot.q, hinge_groups(robot)), "grouped.", readings, out);
  const PointTracks links = link_tracks(robot, motion.robot);
  for_each_reading(readings, "metrics.jerk_scheme", [&](const std::string& name, const MetricReadings& r) {
    add_jerk(tracks.robot_pairs, rate_hz, "." + name, r, out);
    add_jerk(links, rate_hz, ".links." + name, r, out);
  });
  return out;
}

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
