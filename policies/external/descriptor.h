// A policy descriptor (schema duet.policy/1): a policy that is not compiled into duet, as data. A network with what it
// is shown and what its output means, or a program that answers messages. Format: docs/extending.md. Joints are
// named, not yet bound to a robot.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/policies/frame_channels.h"
#include "duet/policies/policy.h"

namespace duet {

inline constexpr int kPlanNumbersBeforeJoints = 7;  // of an anchor: root position (3), quaternion wxyz (4)

enum class PolicyKind { kOnnx, kProcess };

// The frame that the root of an anchor refers to.
enum class PlanFrame {
  kWorld,
  kEgo,           // E of the observation's last frame
  kDisplacement,  // position from the robot's root now, axes and orientation of W
};

struct PolicyInput {
  std::string name;  // of the network's input; "" for its only one
  int line = 0;
  int frames = 1;  // of the history, the current one last
  bool newest_first = false;
  std::vector<Channel> channels;
};

struct PlanFormat {
  int line = 0;
  std::string name;  // of the network's output; "" for its only one
  int anchors = 5;
  int ticks_per_anchor = kTicksPerAnchor;  // the first anchor is now
  PlanFrame frame = PlanFrame::kWorld;
  bool joints_from_neutral = false;
  // Meant is number * scale + offset; one number for all or one for each of an anchor's.
  std::vector<double> scale = {1.0}, offset = {0.0};
};

inline constexpr int kMostMilliseconds = 600000;  // of each of its waits

struct PolicyDescriptor {
  std::string file;  // where it was read, for messages
  std::string name, about;
  PolicyKind kind = PolicyKind::kOnnx;
  std::vector<std::string> joints;  // order of every joint vector; empty: the robot's
  int joints_line = 0;
  // The tasks that it was made for, in the order of the channel `task`; an episode of another is refused.
  std::vector<Task> tasks = {kPaperTasks.begin(), kPaperTasks.end()};
  PolicyFrame frame = PolicyFrame::kWorld;
  PlanFormat output;
  // kOnnx
  std::string network;  // path, from the descriptor's folder
  std::vector<PolicyInput> inputs;
  // kProcess
  std::vector<std::string> command;  // program and arguments, run in the descriptor's folder; or else
  std::string socket;                // where a server listens: a path, from the descriptor's folder, or host:port
  int deadline_ms = 0;               // for a plan, which is left out where it is late; 0: none, duet waits
  int hang_ms = 60000;               // for a plan where there is no deadline; later the policy is dead
  int start_ms = 120000;             // for the first answer and for that to a reset

  [[nodiscard]] std::string folder() const;  // the descriptor's; never empty
};

std::string_view to_string(PolicyFrame frame);
std::string_view to_string(PlanFrame frame);
// Throws InputError("FILE:LINE: ...") as YamlSection does.
PolicyDescriptor parse_policy_descriptor(const std::string& text, const std::string& file);
PolicyDescriptor read_policy_descriptor(const std::string& path);

}  // namespace duet
