// The tasks that WBC-Sim is trained on: commands, rewards (supplement A.3.2), domain randomisation, and the stages that
// the training goes through. Plain data.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/controllers/wbc_sim/tracker.h"
#include "duet/core/numbers.h"
#include "duet/robots/robot_model.h"
#include "duet/rollout/reference_source.h"

namespace duet {

// Weights of the reward; each is multiplied by the tick (0.02 s). Kernels are exp(-error^2 / width^2). Values that the
// supplement gives are marked A.3.2; all other weights and widths were set by hand with the gates in view (`duet bench
// wbc`). Nobody has swept them.
struct RewardWeights {
  double root_xy = 3.0, root_xy_width = 0.25;      // A.3.2: root_position_xy
  double root_near = 2.0, root_near_width = 0.06;  // the same, where it counts
  double upper_body = 4.0,
         upper_body_width = 0.2;            // A.3.2: body position, upper body; root mean square of keypoints [m]
  double hands = 5.0, hands_width = 0.6;    // A.3.2: hands' orientation [rad]
  double joints = 2.0, joints_width = 0.2;  // root mean square of the upper body's joints [rad]
  double height = 1.0, height_width = 0.06;
  double attitude = 2.0, attitude_width = 0.25;  // angle between the pelvis and its reference [rad]
  double velocity = 2.0, velocity_width = 0.25;  // of the root, while stepping [m/s]
  double clock = 2.0;                            // per foot that is where the clock has it
  double lift = 120.0;                           // per (height of the swinging foot - wanted)^2 [1/m^2]
  double foothold = 2.0, foothold_width = 0.1;
  double both_feet = 1.0;                                 // while standing
  double stance = 15.0, narrowest = 0.19, widest = 0.28;  // per metre outside [m]
  double action_rate = 0.03, action_jerk = 0.01, action = 0.01;
  double torque = 2e-5, limits = 5.0, slip = 0.5, spin = 0.05;
  double joint_speed = 2e-4;  // per (rad/s)^2 of the legs
  double self_contact = 1.0;  // per tick with any
  double fall = 100.0;        // A.3.2: termination
};

inline constexpr double kPendulumTime = 0.27;  // sqrt(height of the centre of mass / g) [s]

struct DomainOptions {
  bool randomise = true;
  double torso_mass_low = -1.0, torso_mass_high = 3.0;  // [kg]
  double torso_com = 0.025;                             // [m]
  double mass_scale = 0.05;
  double friction_low = 0.4, friction_high = 1.25;
  double gain_scale = 0.1;
  int steps_per_body = 1500;              // a new body at the first reset after so many
  double kick = 1.0;                      // largest change of the velocity [m/s]
  double kick_from = 3.0, kick_to = 6.0;  // time between kicks [s]
  double push = 0.0;                      // largest force on hands or torso, held for a second [N]
  double push_share = 1.0;                // of episodes that have pushes, and then no kicks
  double push_pause = 4.0;                // between two of them, on average [s]
  double jump = 0.0;                      // of the reference's root, sideways and ahead, five times a second [m]
  double jump_turn = 0.0;                 // likewise of its heading [rad]
  double jump_share = 0.0;                // of episodes in which it jumps
  int latency = 0;                        // physics steps by which a command may come late, at most
};

struct WbcTask {
  std::string name;
  StreamOptions stream;
  RewardWeights reward;
  DomainOptions domain;
  GaitOptions gait;
  double dt = 0.005;  // physics [s]
  // MuJoCo's options: less than half the time of its defaults; what was learnt is tested with those.
  EngineOptions engine = {{"solver", "pgs"}, {"iterations", "12"}, {"cone", "pyramidal"}};
  double entropy = 0.002;    // weight of the policy's entropy
  double largest_std = 1.0;  // of an action
  int episode_ticks = 500;   // A.3.2: 500 steps
  double farthest = 1.0;     // of the root from its reference, where an episode ends as by a fall [m]
};

// "stand", "walk", "brace", "interact". Throws std::invalid_argument naming them.
WbcTask wbc_stage(const std::string& name);

// The cost that RewardWeights::lift weighs: the square of how far a swinging foot is above its wanted height [m]; less
// above than below.
double lift_cost(double above);

// Action: joint target = base + scale a, |a| <= kActionBound; base is the tracker's q.
inline constexpr double kLegScale = 0.35, kUpperScale = 0.25;  // [rad]
Eigen::VectorXd action_scale(const RobotModel& robot);

// Domain randomisation of A.3.2: bodies that are not quite the nominal one.

// The nominal body with other masses and another centre of mass of the torso. Gains, friction, kicks and pushes are the
// environment's.
std::shared_ptr<const RobotModel> draw_body(const RobotModel& nominal, const DomainOptions& options, Random& random);

// The robot's left-right symmetry: what an observation or an action would be in the mirrored situation. The joints
// of its card's legs and arms change places, and what turns about x or z changes sign.

// y[i] = sign[i] x[from[i]].
struct Mirror {
  std::vector<int> from;
  std::vector<float> sign;

  void append(const Mirror& block, int offset);  // of a block that begins at `offset`
  void apply(std::span<const float> x, std::span<float> y) const;
  [[nodiscard]] int size() const { return static_cast<int>(from.size()); }
};

// Throws std::invalid_argument where a link has no counterpart.
Mirror mirror_joints(const RobotModel& robot);
Mirror mirror_actor(const RobotModel& robot);                                  // kOracle's observation
Mirror mirror_critic(const RobotModel& robot, const std::vector<int>& links);  // actor and bodies

}  // namespace duet
