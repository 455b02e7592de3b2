// Demonstrations for D-STAR: what the robot was seen to do beside a partner, and what it was meant to do. Frames of all
// demonstrations lie in one matrix per channel, so that a set of hours is a few hundred megabytes and one file.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/core/robot_state.h"
#include "duet/core/task.h"

namespace duet {

struct Demonstration {
  std::string clip_id;
  std::string digest;  // SHA-256 of the clip that it comes from: splits are told apart by it
  Task task = Task::kHug;
  Phases phases;
  bool leads = false;         // the robot begins, before a partner who goes on waiting: the command says so
  int begin = 0, frames = 0;  // columns of the set; 50 Hz

  [[nodiscard]] int end() const { return begin + frames; }
};

// For a robot of n joints: observed (13 + 2n, frames): root position and quaternion wxyz, v_WB, w_WB_B, q, v; wanted
// (7 + n, frames): root position, quaternion wxyz, q; partner (72, frames): SMPL joints in W.
struct DemonstrationSet {
  std::string robot_digest;
  std::string origin;  // how it was made, in words: another way makes another set
  std::vector<Demonstration> list;
  Eigen::MatrixXf observed, wanted, partner;

  [[nodiscard]] int frames() const { return static_cast<int>(wanted.cols()); }
  // All three as long as one another (std::invalid_argument otherwise); begin and frames of `entry` are set here.
  void add(Demonstration entry, const std::vector<RobotState>& seen, const RobotMotion& meant,
           const PointTracks& partner_joints);
  // All of another set, of the same robot (std::invalid_argument otherwise).
  void append(const DemonstrationSet& other);
  [[nodiscard]] RobotState state(int column) const;
  [[nodiscard]] Reference reference(int column) const;
};

// Kinematic observation: the state that would follow the motion exactly (central differences).
std::vector<RobotState> states_of(const RobotMotion& motion);

// One safetensors file. Loading throws InputError (file, what, expected, found): another robot or origin, sizes, names.
void save_demonstrations(const DemonstrationSet& set, const std::string& path);
DemonstrationSet load_demonstrations(const std::string& path, const std::string& robot_digest,
                                     const std::string& origin);

// Throws InputError naming the clip where one of `digests` (of clips held out for tests) is in the set.
void check_held_out(const DemonstrationSet& set, const std::vector<std::string>& digests, const std::string& split);
// Lines of "digest  clip_id"; comments begin with '#'. Throws InputError (file, line, expected, found).
std::vector<std::string> load_split(const std::string& path);

}  // namespace duet
