// A servo of a hand's last way: where a policy's own reference has a hand near one that the partner holds out, the
// arm's joints are corrected at 50 Hz so that the two hands meet, and the root for what the arm lacks. It works in
// tasks whose rule asks for hands at hands (tasks/task_definition.h) and uses nothing but what the policy sees.
#pragma once

#include <memory>

#include "duet/core/task.h"
#include "duet/policies/policy.h"

namespace duet {

inline constexpr const char* kHandServo = "hand_servo";  // the option by which a suite asks for it

// `near` works on the last decimetres; `wide` also on half a metre in tasks whose hands have to stay together, and
// towards hands that were not raised but held out level.
enum class HandServoReach { kNone, kNear, kWide };

// Between two bounds the correction grows smoothly from nothing to all of it (docs/deviations.md, P27).
struct HandServoBounds {
  double far = 0.30, near = 0.20;   // distance of the reference's hand from the partner's seen one [m]
  double low = 0.08, high = 0.16;   // rise of the partner's hand over the lowest place that it had [m]
  double out = 0.0, all_out = 0.0;  // how far it came towards the robot, level, from its least; 0: does not count [m]
  double ahead = 0.03;              // the hand is met where it will be then, at its present speed [s]
  double stretch = 0.98;            // the hand goes no farther from the shoulder, of the arm's length [1]
  double joint_rate = 3.0;          // of a joint's correction [rad/s]
  double horizon = 1.0;             // the root's counts where the plan comes near within this [s]
  double bent = 0.95;               // what lies farther from the shoulder is asked of the root, of the arm's length [1]
  double root = 0.12;               // the root's correction, level towards the hand [m]
  double root_rate = 0.4;           // and its rate [m/s]
  double root_ahead = 0.10;         // the root counts with the hand where it will be then [s]
};

// Whether the servo may correct the reference in a task.
bool is_hand_to_hand(Task task);
HandServoBounds hand_servo_bounds(HandServoReach reach, Task task);

// The policy with the servo, which corrects (Policy::correct) in those tasks. Its plans are the policy's; where no hand
// is near or none is held out, and nothing is left to let go of, the reference stays as it is to the bit. Throws
// std::invalid_argument for a robot without arms.
std::unique_ptr<Policy> with_hand_servo(std::unique_ptr<Policy> policy, std::shared_ptr<const RobotModel> robot,
                                        HandServoReach reach = HandServoReach::kNear);

}  // namespace duet
