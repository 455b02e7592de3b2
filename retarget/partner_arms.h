// The parts of the partner that PAIR moves: shoulders, elbows and wrists, 6 offsets a frame; and his arm bones, whose
// lengths are those of the source. Pure.
#pragma once

#include <Eigen/Core>

#include "duet/motion/human_motion.h"

namespace duet {

inline constexpr int kHumanOffsets = 6;          // shoulders, elbows, wrists; left before right
inline constexpr int kArmBones = kHumanOffsets;  // bone k ends at offset k: collar - shoulder - elbow - wrist

// Offset of a joint of the partner: 0..5, or -1 for a joint that stays. Hands follow wrists.
int human_offset_of(int smpl);

// The offset that bone k begins at, -1 for a collar, which stays.
inline int bone_begin(int bone) { return bone < 2 ? -1 : bone - 2; }

// The six bones of every frame, begin to end, (18, T) [m].
Eigen::MatrixXd arm_bones(const HumanMotion& person);

// Moves shoulders, elbows and wrists of `adapted` to the nearest places where each bone has its length in `source` in
// that frame, exactly: the shoulder on a sphere about the collar, the elbow on the circle that the two bones of the arm
// allow, on the side where it was. The wrist stays where it is within reach; the hand follows it.
void keep_arm_lengths(const HumanMotion& source, HumanMotion& adapted);

}  // namespace duet
