// When a body begins its act: the moment its hands leave where they are carried while it prepares. Compares how soon a
// robot answers a partner who starts earlier or later. Pure functions.
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/robots/robot_model.h"

namespace duet {

inline constexpr double kOnsetDistance = 0.12;  // [m]
inline constexpr double kOnsetRest = 1.0;       // the first second says where the hands are carried [s]
inline constexpr double kOnsetWindow = 0.2;     // [s]
// An arm that swings with the steps leaves its place for less. [s]
inline constexpr double kOnsetStay = 0.6;

// `hands`: each (3, T) [m] in a frame that goes with the body, T alike. The first time from kOnsetRest on at which a
// hand's distance from its median place (per axis) over the first kOnsetRest, as a mean over the kOnsetWindow from then
// on, exceeds kOnsetDistance and goes on to for kOnsetStay. NaN where none does or the motion is too short to tell. [s]
double onset(const std::vector<Eigen::Matrix3Xd>& hands, double rate_hz);

// "onset_s": of the robot as executed, keypoints lhand and rhand in the pelvis frame; "partner_onset_s": of the
// partner's wrists in the frame of its root, which turns with the hips about z. NaN where never, or without a partner.
std::map<std::string, double> onsets(const Recording& recording, const RobotModel& robot);

}  // namespace duet
