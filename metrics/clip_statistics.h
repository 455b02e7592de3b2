// The statistics of Table S5 of the supplement on two people's motion, per clip. Its definitions are not printed there;
// those below are ours (docs/deviations.md, D12). Pure functions.
#pragma once

#include <limits>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include "duet/motion/interaction_clip.h"

namespace duet {

struct ClipStatistics {
  double seconds = 0.0;                 // of the clip
  double contact_events_per_s = 0.0;    // times that the people begin to be nearer than kContactDistance [1/s]
  double contact_ratio = 0.0;           // share of frames in which they are
  double nearest_joint_distance = 0.0;  // least distance of a joint of one from one of the other, mean over frames [m]
  double aabb_overlap_iou = 0.0;        // of the two people's axis-aligned boxes over their joints, mean over frames
  double joint_speed_p95 = 0.0;         // over frames, joints and both people [m/s]
  double joint_acceleration_p95 = 0.0;  // likewise [m/s^2]
  double com_outside_support = 0.0;  // share of frames and people whose centre of mass lies, seen from above, outside
                                     // the box around both ankles and toes
};

inline constexpr double kContactDistance = 0.2;  // [m] between joints: the nearest threshold of supplement C.2.1

// Throws std::invalid_argument for fewer than 3 frames.
ClipStatistics clip_statistics(const InteractionClip& clip);

// Centre of mass of a person: segments between joints with the mass fractions and centres of de Leva (J. Biomechanics
// 29, 1996), mean of the sexes. joints: (3, 24) of one frame [m].
Eigen::Vector3d centre_of_mass(const PointTracks::ConstFrame& joints);

// Table S5's rows: "contact_events_per_s", ...; with their titles and units, in its order.
struct StatisticInfo {
  std::string_view name, title, unit;
  double ClipStatistics::*value;
};
std::span<const StatisticInfo> clip_statistic_catalogue();

// Means weighted by the clips' seconds; zeros for none. `seconds` is the sum.
ClipStatistics pooled(std::span<const ClipStatistics> clips);

// How two people interact in a clip: when and where they touch, how they come to it, how fast, with which hand, and
// what their tracker did to them. Compares synthetic clips with recorded ones (docs/synthesis.md). Pure functions.

inline constexpr double kUnknownStatistic = std::numeric_limits<double>::quiet_NaN();

// The touch is that of the task: hands of the two nearer than kHandsTouch; in a hug, a hand of either nearer than
// kEmbrace to the other's line from pelvis to neck. A gesture without touch lasts as long as the clip's act does. NaN
// where a clip says nothing of it: no touch, no onset.
struct InteractionStatistics {
  double seconds = 0.0;                         // of the clip
  double touches = 0.0;                         // 1: there is a touch (or a gesture), 0: there is none
  double touch_s = kUnknownStatistic;           // time in touch, all touches together [s]
  double before_s = kUnknownStatistic;          // from the first frame to the first touch [s]
  double after_s = kUnknownStatistic;           // from the last touch to the end of the clip [s]
  double touch_distance = kUnknownStatistic;    // of the roots, level, at the first touch [m]
  double largest_distance = kUnknownStatistic;  // of the roots, level, in the clip [m]
  double touch_bearing = kUnknownStatistic;     // of the other from either's facing, to the right, mean of both [deg]
  double turned_hips = kUnknownStatistic;       // to the left, from the first frame to mid-touch, mean of both [deg]
  double touch_turn = kUnknownStatistic;        // by which the two do not face opposite ways then [deg]
  double hips_aside = kUnknownStatistic;        // of the other from where hips face, at the touch, the larger [deg]
  double ankles_aside = kUnknownStatistic;      // likewise from the line at right angles to that of the ankles [deg]
  double lean = kUnknownStatistic;              // of pelvis to neck from upright, p95 over frames, the larger [deg]
  double raised = kUnknownStatistic;            // of the higher hand over its pelvis, p95 over frames, the larger [m]
  double touch_height = kUnknownStatistic;      // of the touching hands over the lowest foot, mean in touch [m]
  double approach_speed = kUnknownStatistic;    // fastest closing of the roots over kApproachWindow [m/s]
  double root_speed_p95 = kUnknownStatistic;    // of either root over kApproachWindow, over frames, mean of both [m/s]
  double hand_speed_p95 = kUnknownStatistic;    // of the faster hand, over frames, mean of both people [m/s]
  double joint_speed_p95 = kUnknownStatistic;   // as in Table S5 (metrics/clip_statistics.h) [m/s]
  double reaction_s = kUnknownStatistic;        // from the first hand that sets out to the other person's [s]
  double right_hands = kUnknownStatistic;       // share of the hands in act that are right ones: 0, 0.5 or 1
  double standing = kUnknownStatistic;          // share of the two whose root stays within kStanding: 0, 0.5 or 1
  double source_rate_hz = kUnknownStatistic;    // of the recording, before it was resampled [Hz]
  double noise = kUnknownStatistic;             // median residual of trunk joints, see kNoiseStep [m]
  double arm_change_p95 = kUnknownStatistic;    // of the arms' bones against their median, over frames [1]
  double arm_occluded = kUnknownStatistic;      // share of frames and arms with a bone changed by over kOccluded [1]
  double feet_aside = kUnknownStatistic;        // of an ankle from below its hip, level, median, mean of all four [m]
  double neck_height = kUnknownStatistic;       // of the neck over the pelvis, median, mean of both [m]
  double stature = kUnknownStatistic;           // of the head joint over the lowest joint, median, mean of both [m]
  double arm_length = kUnknownStatistic;        // shoulder to wrist, median, mean of both [m]
};

inline constexpr double kHandsTouch = 0.15;     // [m]
inline constexpr double kEmbrace = 0.25;        // [m]
inline constexpr double kApproachWindow = 0.5;  // [s]
inline constexpr double kStanding = 0.15;       // [m]
inline constexpr double kSetOut = 0.12;         // a hand has set out so far from where it was, seen from the root [m]
// A joint against the middle of where it was and will be after such a time: 0 for steady motion, and for white noise of
// a standard deviation s an axis 1.9 s. [s]
inline constexpr double kNoiseStep = 1.0 / 15.0;
inline constexpr double kOccluded = 0.10;

// Throws std::invalid_argument for fewer than 3 frames.
InteractionStatistics interaction_statistics(const InteractionClip& clip);

// Each is told as a quantile over clips, or (shares) as the mean.
struct InteractionStatisticInfo {
  std::string_view name, title, unit;
  double InteractionStatistics::*value;
  bool is_share;
};
std::span<const InteractionStatisticInfo> interaction_statistic_catalogue();

// The spread of one statistic over clips that have it.
struct StatisticSpread {
  int clips = 0;
  double low = 0.0, middle = 0.0, high = 0.0;  // 5 %, 50 %, 95 %; a share has its mean in all three; NaN for none
};
StatisticSpread spread_of(std::span<const InteractionStatistics> clips, const InteractionStatisticInfo& info);

// The middles of two sets agree where they differ by at most kAgreement of the second's (of 1 for a share); angles,
// which may lie about 0, also where they differ by at most kAngleAgreement.
inline constexpr double kAgreement = 0.20;
inline constexpr double kAngleAgreement = 6.0;  // [deg]
bool agree(const StatisticSpread& one, const StatisticSpread& other, const InteractionStatisticInfo& info);

}  // namespace duet
