// A carried object's keypoints in vectors: the robot's and the partner's keypoints keep their distances from them.
// Included by kernel_body.h only.
#pragma once

#include "duet/retarget/kernels/kernel_frame.h"

namespace duet::pair_kernel {
namespace {

// Keypoint i of `keys` of one of the two, against all points of the object; the pull on it is added to `pull`.
inline V object_rows(const Place& at, const V* key, int points, int distances, V scale, V* pull) {
  V sum = V{};
  for (int o = 0; o < at.setup.objects; ++o) {
    V d[3];
    for (int r = 0; r < 3; ++r) d[r] = key[r] - at.constant(points + 3 * o + r);
    const V length = square_root(dot(d, d) + kGuard);
    const V error = length - at.constant(distances + o);
    sum += error * error;
    const V f = error * scale / length;
    for (int r = 0; r < 3; ++r) pull[r] += f * d[r];
  }
  return sum;
}

// After con_term, which places the keypoints, and before hum_term, which takes the partner's pulls on.
inline void object_term(const Place& at, Work& k) {
  const int keys = at.setup.keys;
  const int points = at.setup.object_row;
  const V weight = at.constant(kWeight);
  int row = points + 3 * at.setup.objects;
  V robot_sum = V{};
  V human_sum = V{};
  for (int i = 0; i < 2 * keys; ++i) {
    const bool robot = i < keys;
    const float own = at.setup.key_object[robot ? i : i - keys];
    const float factor = robot ? at.step.object_robot : at.step.object_human;
    if (own != 0.0f && factor != 0.0f && (robot || at.setup.adapt_human)) {
      V* pull = robot ? k.pull[at.setup.key_point[i]] : k.key_pull[i];
      const V sum = own * object_rows(at, k.key[i], points, row, weight * (factor * own), pull);
      if (robot) robot_sum += sum;
      if (!robot) human_sum += sum;
    }
    row += at.setup.objects;
  }
  at.add(kObjectRobot, weight * robot_sum);
  at.add(kObjectHuman, weight * human_sum);
}

}  // namespace
}  // namespace duet::pair_kernel
