// The scenes of the suite, by what they need. Internal to backends/conformance.
#pragma once

#include <string>

#include "duet/robots/robot_model.h"

namespace duet::conformance {

class Trial;

// state_scenes.cpp
void measure_state(Trial& trial);
void measure_acceleration(Trial& trial);
// flight_scenes.cpp
void measure_free_flight(Trial& trial);
void measure_momentum(Trial& trial);
// box_scenes.cpp
void measure_box_simple(Trial& trial);
void measure_box_complex(Trial& trial);
// swing_scenes.cpp
void measure_pendulum(Trial& trial);
void measure_chain(Trial& trial);
// joint_scenes.cpp
void measure_armature(Trial& trial);
void measure_effort(Trial& trial);
void measure_step_response(Trial& trial);
void measure_saturation(Trial& trial);
void measure_joint_stop(Trial& trial);
// friction_scenes.cpp
void measure_incline(Trial& trial);
void measure_rolling_ball(Trial& trial);
// bounce_scenes.cpp
void measure_skin_bounce(Trial& trial);
void measure_ground_bounce(Trial& trial);
// standing_scenes.cpp
void measure_stand(Trial& trial);
std::string lacks_ankles(const RobotModel& robot);  // two legs that end in a pitch and a roll, and soles
void measure_fall(Trial& trial);
std::string lacks_soles(const RobotModel& robot);
void measure_held_push(Trial& trial);
std::string lacks_trunk_or_ankles(const RobotModel& robot);  // a shape of the region "torso", too
// self_collision_scene.cpp
void measure_self_collision(Trial& trial);
std::string lacks_hand_poses(const RobotModel& robot);  // the poses hand_before_trunk and hand_in_trunk
// repeat_scene.cpp
void measure_repeat(Trial& trial);

}  // namespace duet::conformance
