// A stand-in for a camera and its estimator: a person of a clip, seen with noise. Deterministic by its seed. One owner,
// one thread.
#pragma once

#include "duet/core/random.h"
#include "duet/hardware/person_input.h"
#include "duet/motion/human_motion.h"

namespace duet {

struct PersonPlay {
  double rate = 30.0;   // estimates a second
  double noise = 0.02;  // on each axis of each joint, standard deviation [m]
  double unseen = 0.0;  // share of estimates without anybody
  std::uint64_t seed = 1;
};

class PersonPlayer {
 public:
  // `X_WB`: where the robot's base stands in the clip; it is taken to stay there. `X_BC`: of the camera on the base.
  // Throws std::invalid_argument for a rate that is not above 0, a negative noise, a share outside 0 to 1.
  PersonPlayer(const HumanMotion& person, const Pose& X_WB, const Pose& X_BC, const PersonPlay& play);

  // The next estimate, or false at the clip's end.
  bool next(PersonEstimate& estimate);
  [[nodiscard]] int frames() const { return person_.frames(); }  // estimates of the clip

 private:
  HumanMotion person_;  // at the rate of the estimates
  Pose X_CW_;
  PersonPlay play_;
  Random random_;
  int frame_ = 0;
};

// Where a robot that replaces this person stands at first: the pelvis over the ground, turned as the person is.
Pose base_of_reactor(const HumanMotion& reactor, double height);

}  // namespace duet
