// One observation for one policy, and its answer: a check for authors of policies before a run.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "duet/policies/policy.h"
#include "duet/robots/robot_model.h"

namespace duet {

// A channel as the policy was shown it, over all frames of its input.
struct ShownChannel {
  std::string name;
  int size = 0;  // numbers of a frame
  double low = 0.0, high = 0.0;
};

struct ShownInput {
  std::string name;
  int frames = 1;
  std::vector<ShownChannel> channels;

  [[nodiscard]] int size() const;  // numbers of all frames
};

struct PolicyCheck {
  PolicyInfo info;
  std::string clip;                // whose beginning it was shown
  std::string output;              // "5 anchors of 36 numbers, 0.5 s apart, frame world"; "" for one of duet's own
  std::vector<ShownInput> inputs;  // in the order of the descriptor
  std::vector<Reference> plan;     // what the scheduler would get, from now on at 50 Hz; empty where it gave none
  double root_distance = 0.0;      // of the plan's first root from the robot's [m]
  double root_turn = 0.0;          // and between their orientations [rad]
  int joints_at_limits = 0;        // of the plan's first reference
  double make_ms = 0.0, reset_ms = 0.0, plan_ms = 0.0;
  PolicyFaults faults;
};

// Makes the policy `use` (a name or a descriptor's path), resets it for an episode of `task` on a synthesised clip and
// asks for one plan. Throws as policy_maker. A program that does not answer as it should is a fault, not a throw.
PolicyCheck check_policy(const std::string& use, const std::shared_ptr<const RobotModel>& robot,
                         const PolicyOptions& options, Task task);

// Describes what the policy was shown, what came back and how long that took, a line each.
std::string describe(const PolicyCheck& check);

}  // namespace duet
