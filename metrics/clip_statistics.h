// The statistics of Table S5 of the supplement on two people's motion, per clip. Its definitions are not printed there;
// those below are ours (docs/deviations.md, D12). Pure functions.
#pragma once

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

}  // namespace duet
