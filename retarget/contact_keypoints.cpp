#include "duet/retarget/contact_keypoints.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "duet/core/names.h"
#include "duet/core/number.h"
#include "duet/core/require.h"
#include "duet/core/skeleton.h"
#include "duet/core/split.h"

namespace duet {
namespace {

double weight_of(std::string_view text, std::string_view entry) {
  const std::optional<double> value = parse_number(text);
  require(value.has_value() && *value >= 0.0,
          "keypoint '{}': expected a weight, a finite number of zero or more, found '{}'", entry, text);
  return *value;
}

ContactKeypoint keypoint_of(std::string_view entry) {
  const std::vector<std::string_view> parts = split(entry, ':');
  require(parts.size() <= 3, "keypoint '{}': expected joint[@frame][:weight[:object]]", entry);
  const std::vector<std::string_view> names = split(parts[0], '@');
  require(names.size() <= 2 && !(names.size() == 2 && names[1].empty()),
          "keypoint '{}': expected joint[@frame][:weight[:object]]", entry);
  const auto joint = std::find(kSmplNames.begin(), kSmplNames.end(), names[0]);
  if (joint == kSmplNames.end()) {
    const std::vector<std::string> known(kSmplNames.begin(), kSmplNames.end());
    throw std::invalid_argument(unknown_name_message("joint", std::string(names[0]), known));
  }
  ContactKeypoint keypoint;
  keypoint.smpl = static_cast<int>(joint - kSmplNames.begin());
  if (names.size() == 2) keypoint.frame = names[1];
  if (parts.size() > 1) keypoint.weight = weight_of(parts[1], entry);
  if (parts.size() > 2) keypoint.object = weight_of(parts[2], entry);
  return keypoint;
}

// The frame that the card pairs with the joint: a keypoint of interaction, else one of the 16 pairs.
int frame_of_card(const RobotModel& robot, int smpl) {
  for (const Keypoint& key : robot.keypoints)
    if (key.smpl == smpl) return key.frame;
  for (const RetargetPair& pair : robot.pairs)
    if (pair.smpl == smpl) return pair.frame;
  throw std::invalid_argument(fmt::format("robot '{}': its card pairs no frame with the joint '{}'; expected {}@frame",
                                          robot.name, kSmplNames[static_cast<std::size_t>(smpl)],
                                          kSmplNames[static_cast<std::size_t>(smpl)]));
}

bool is_one_of(int smpl, int left, int right) { return smpl == left || smpl == right; }

}  // namespace

std::vector<ContactKeypoint> parse_contact_keypoints(const std::string& text) {
  std::vector<ContactKeypoint> keypoints;
  if (text.empty()) return keypoints;
  for (const std::string_view entry : split(text, ',')) {
    ContactKeypoint keypoint = keypoint_of(entry);
    for (const ContactKeypoint& other : keypoints)
      require(other.smpl != keypoint.smpl, "keypoint '{}': its joint is named twice", entry);
    keypoints.push_back(std::move(keypoint));
  }
  return keypoints;
}

std::string format_contact_keypoints(const std::vector<ContactKeypoint>& keypoints) {
  std::string text;
  for (const ContactKeypoint& keypoint : keypoints) {
    if (!text.empty()) text += ',';
    text += kSmplNames[static_cast<std::size_t>(keypoint.smpl)];
    if (!keypoint.frame.empty()) text += "@" + keypoint.frame;
    const bool has_object = keypoint.object != kObjectByRule;
    if (keypoint.weight != 1.0 || has_object) text += fmt::format(":{}", keypoint.weight);
    if (has_object) text += fmt::format(":{}", keypoint.object);
  }
  return text;
}

std::vector<int> robot_frames(const RobotModel& robot, const std::vector<ContactKeypoint>& keypoints) {
  std::vector<int> frames;
  frames.reserve(keypoints.size());
  for (const ContactKeypoint& keypoint : keypoints)
    frames.push_back(keypoint.frame.empty() ? frame_of_card(robot, keypoint.smpl) : robot.frame_index(keypoint.frame));
  return frames;
}

std::vector<double> object_weights(const std::vector<ContactKeypoint>& keypoints) {
  const bool hands = std::any_of(keypoints.begin(), keypoints.end(), [](const ContactKeypoint& keypoint) {
    return is_one_of(keypoint.smpl, kLeftHand, kRightHand);
  });
  std::vector<double> weights;
  weights.reserve(keypoints.size());
  for (const ContactKeypoint& keypoint : keypoints) {
    const bool chosen =
        hands ? is_one_of(keypoint.smpl, kLeftHand, kRightHand) : is_one_of(keypoint.smpl, kLeftWrist, kRightWrist);
    weights.push_back(keypoint.object != kObjectByRule ? keypoint.object : chosen ? 1.0 : 0.0);
  }
  return weights;
}

}  // namespace duet
