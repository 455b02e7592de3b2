// The scenes of the suite, by what they need. Internal to backends/conformance.
#pragma once

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
void measure_fall(Trial& trial);
void measure_held_push(Trial& trial);
// self_collision_scene.cpp
void measure_self_collision(Trial& trial);
// repeat_scene.cpp
void measure_repeat(Trial& trial);

}  // namespace duet::conformance
