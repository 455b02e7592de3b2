// Supplement A.4.4, and section D with Algorithm 7: adapts a retargeted motion by phase. Act is kept; preparation and
// follow-up become smooth primitives.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "duet/core/recording.h"
#include "duet/core/task.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/roles.h"

namespace duet {

enum class StartMode {
  kClip,       // the motion as retargeted, whole clip
  kApproach,   // A.4.4: root starts within 1 m of the original start, bilinear interpolation to the first act frame
  kAct,        // for controllers that cannot walk: root at the act position from the start, upper body ramps in place
  kSimToReal,  // Algorithm 7: what a policy is fine-tuned on before it meets the real robot
};

struct AdaptedMotion {
  RobotMotion motion;  // 50 Hz
  Phases phases;       // of its frames
  int clip_frame = 0;  // frame of the clip that its frame 0 is: the partner's motion is cut there
};

struct AdaptationOptions {
  StartMode start = StartMode::kApproach;
  double start_radius = 1.0;        // [m], kApproach
  double lead = 1.0;                // of neutral-to-act ramp kept before the act with kAct [s]
  double return_time = 1.0;         // over which the upper body goes back to neutral after the act [s]
  double mild_yaw = kSimToRealYaw;  // kSimToReal: largest turn of the root on its way to the act [rad]
  double walks = 0.0;  // kApproach: its speed [m/s], so that it is there early and waits; 0: arrives as the act begins
  bool hold_stance = true;  // kAct: legs stay in the standing pose, the pelvis keeps its act position on the ground
  bool keep_torso = true;   // kAct with hold_stance: the waist takes over, inside its limits, what the pelvis loses of
                            // its turn and tilt, so that the torso is oriented as in the clip; false: waist as in the
                            // clip
};

// Legs are those of the robot's card, every other joint is upper body. Where the base is the trunk and the pelvis hangs
// on a waist below it, the pelvis is what stands at the act position, and the base is where the waist has it. kClip:
// the motion to the bit. kApproach: act to the bit. Before it the root goes from a start drawn uniformly from the disc
// around the clip's start
//   (height and orientation as there) straight to the first act frame, the upper body from neutral; legs as in the
//   clip. After it root and legs stay as in the last act frame, the upper body goes back to neutral. With `walks` it is
//   there as soon as that speed allows, waits as in the first act frame with a neutral upper body, and the upper body
//   comes into the act over its first 0.4 s.
// kAct: the clip from `lead` before the act on (all of it, where the preparation is shorter). With hold_stance the root
//   stands upright at x, y and yaw of the act's middle frame at the robot's standing height, legs standing; the upper
//   body goes from neutral to the first act frame, through the act and back. Without hold_stance root and legs wait in
//   the first act frame, go through the act to the bit and stay in its last frame.
// kSimToReal: act to the bit. Before it the root goes from the clip's start straight to the first act frame and turns
// by
//   at most `mild_yaw`; the upper body is neutral and goes to the first act frame over the last 16 frames; legs as in
//   the clip. After it root and legs stay as in the last act frame, the upper body goes back to neutral over 16 frames.
// A follow-up shorter than `return_time` ends on the way to neutral: no frame is added, the partner has none for it.
// The seed matters to kApproach only: the same seed gives the same bits.
// Throws std::invalid_argument where the motion is not valid, not at 50 Hz or not of this robot's joints in its order,
// where the phases do not fit it (0 <= act_begin < act_end <= frames) or options are out of range.
AdaptedMotion adapt_by_phase(const RobotMotion& motion, const Phases& phases, const RobotModel& robot,
                             const AdaptationOptions& options, std::uint64_t seed);

// Waist angles that turn the torso as asked: what is left to a robot whose pelvis has to stand upright. Thread-safe.
class TorsoOrientation {
 public:
  // The waist is the card's; there may be none. It stands between pelvis and trunk, either of which may be the base.
  explicit TorsoOrientation(const RobotModel& robot);

  // Orientation of the trunk in the pelvis, R_PT: of the link above the last waist joint in the base, or where the
  // waist is below the base, of the base in the link below it.
  [[nodiscard]] Eigen::Quaterniond at(const Eigen::VectorXd& q) const;
  // Sets the waist joints of `q`, inside their limits, to bring at(q) as near to R_PT as they can (smallest angle);
  // starts from those in `q` and is made for goals within a right angle of at(q): from further away, or where the way
  // there leads through a limit of the yaw, it may end at a worse answer. A continuous function of both as long as
  // there is one best answer.
  void solve(const Eigen::Quaterniond& R_PT, Eigen::VectorXd& q) const;

 private:
  void turn_round();

  struct Hinge {
    Eigen::Quaterniond R_before;  // from the frame that is nearer to the pelvis to that of the hinge
    Eigen::Vector3d axis;
    int joint;
    bool waist;  // free to move in solve()
    double lower, upper;
  };
  std::vector<Hinge> chain_;                                   // from the pelvis to the trunk
  Eigen::Quaterniond R_end_ = Eigen::Quaterniond::Identity();  // of the trunk in the frame of the last hinge
};

}  // namespace duet
