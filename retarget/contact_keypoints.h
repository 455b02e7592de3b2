// Which joints of the person and points of the robot stand for each other in PAIR's contact term, K_H and K_R of
// supplement A.1.1, and with what weight: data that a user may name ("By redefining task contact keypoints", Fig. S3).
#pragma once

#include <string>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

inline constexpr double kObjectByRule = -1.0;

struct ContactKeypoint {
  int smpl = 0;                   // SMPL-24 joint of the person
  std::string frame = {};         // of the robot; empty: what its card pairs with that joint
  double weight = 1.0;            // w_i: a distance between keypoints i and j counts w_i w_j times
  double object = kObjectByRule;  // likewise for its distances from a carried object, or by the rule
  bool operator==(const ContactKeypoint&) const = default;
};

// "left_hand:2,right_hand:2:1,left_wrist@left_wrist_yaw_link": joint[@frame][:weight[:object]], by commas. Throws
// std::invalid_argument that says what was expected: an unknown joint, one that is named twice, a weight that is no
// finite number of zero or more.
std::vector<ContactKeypoint> parse_contact_keypoints(const std::string& text);
std::string format_contact_keypoints(const std::vector<ContactKeypoint>& keypoints);

// The robot's frame of each. Throws std::invalid_argument naming the robot: a frame that it has not, a joint that its
// card pairs with nothing.
std::vector<int> robot_frames(const RobotModel& robot, const std::vector<ContactKeypoint>& keypoints);

// Weights of the distances from an object where the rule decides: 1 for hands, or for wrists where there is no hand
// among the keypoints, else 0.
std::vector<double> object_weights(const std::vector<ContactKeypoint>& keypoints);

}  // namespace duet
