// The source of the robot's reference: one 36-D reference a tick.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/core/numbers.h"
#include "duet/core/recording.h"
#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet {

// 36-D references at 50 Hz to train and to test a whole-body controller on: an upper body that moves between random
// poses, a root that walks by command, or motions of a data set. All randomness comes from the generator that is
// passed.

// A command that is held, then zero. [m/s], [m/s], [rad/s]
struct ScriptedCommand {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  double begin = 1.0, end = 7.0;  // [s]
  double pause = 0.0;             // where > 0: on and off in turn, each for so long (stop and go) [s]
};

struct StreamOptions {
  bool moves_upper_body = true;
  bool holds_upper_body = false;  // goes to one pose that is drawn and stays in it, in the place of moving on
  bool from_neutral = false;      // the upper body's first pose is the neutral one, in which the robot can begin
  double moving = 0.0;            // share of command segments in which the root moves; 0: it stands for ever
  double max_speed = 0.4;         // forward; sideways and back about half of it [m/s]
  double crouch = 0.0;            // share of segments with another height of the pelvis
  double bow = 0.0;               // share of segments with the pelvis pitched
  double motions = 0.0;           // share of episodes that follow one of `data`
  std::shared_ptr<const std::vector<RobotMotion>> data;  // shared by all streams; read-only
  std::optional<ScriptedCommand> script;                 // in place of random commands
  std::optional<Eigen::VectorXd> posture;                // joints in the place of the robot's neutral ones [rad]
};

class ReferenceStream {
 public:
  // Throws std::invalid_argument for shares out of [0, 1], for `motions` without data and for data of another robot.
  ReferenceStream(std::shared_ptr<const RobotModel> robot, const StreamOptions& options);

  // Begins an episode at the origin, heading +x.
  void reset(Random& random);
  // The next reference, 0.02 s after the last one.
  void advance(Random& random);
  [[nodiscard]] const Reference& reference() const { return reference_; }
  [[nodiscard]] const Eigen::Vector3d& command() const { return velocity_; }  // that moves the root now

 private:
  [[nodiscard]] const Eigen::VectorXd& neutral() const;
  void draw_pose(Random& random, Eigen::VectorXd& q) const;
  void draw_command(Random& random);
  void follow_script();
  void move_upper_body(Random& random);
  void move_root();
  void follow_motion();

  std::shared_ptr<const RobotModel> robot_;
  StreamOptions options_;
  RootBounds bounds_;  // of a robot that crouches
  std::vector<int> upper_;
  Reference reference_;
  Eigen::VectorXd from_, to_;  // poses that the upper body moves between
  double segment_ = 0.0, segment_length_ = 1.0;
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();
  double yaw_ = 0.0, height_ = 0.0, height_goal_ = 0.0, pitch_ = 0.0, pitch_goal_ = 0.0;
  int command_ticks_ = 0, tick_ = 0;
  const RobotMotion* motion_ = nullptr;
  int frame_ = 0;
  Pose X_OM_;  // moves the motion's first frame to the origin
};

// The present, which is all that a source may look at. `partner` is null where nobody is there.
struct TickView {
  int tick = 0;
  const RobotState& robot;
  const HumanJoints* partner = nullptr;
};

class ReferenceSource {
 public:
  virtual ~ReferenceSource() = default;
  // Called before tick 0, where engine and controller stand in `start`.
  virtual void begin(const RobotState& start) = 0;
  // The reference of this tick; ticks come in order from 0. Valid until the next call. Null: there is none any more.
  virtual const Reference* at(const TickView& present) = 0;
  // Why there is no reference any more.
  [[nodiscard]] virtual std::string message() const { return ""; }
};

// A motion, its last frame held. Refers to it.
class MotionReference final : public ReferenceSource {
 public:
  explicit MotionReference(const RobotMotion& motion) : motion_(motion) {}
  void begin(const RobotState&) override {}
  const Reference* at(const TickView& present) override;

 private:
  const RobotMotion& motion_;
  Reference reference_;
};

// A stream of references by command (rollout/reference_source.h): it begins at the origin, heading along x.
class StreamReference final : public ReferenceSource {
 public:
  // Throws what ReferenceStream throws.
  StreamReference(std::shared_ptr<const RobotModel> robot, const StreamOptions& options, std::uint64_t seed);
  void begin(const RobotState& start) override;
  const Reference* at(const TickView& present) override;
  [[nodiscard]] const ReferenceStream& stream() const { return stream_; }

 private:
  Random random_;
  ReferenceStream stream_;
};

}  // namespace duet
