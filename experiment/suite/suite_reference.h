// The key `reference` of a suite: roots that move by command in the place of clips and policies. Does the robot walk,
// how fast, does it fall: nobody else is there, and no clip gives the episode its length.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "duet/controllers/controller.h"
#include "duet/core/episode_tags.h"
#include "duet/robots/yaml_section.h"
#include "duet/rollout/reference_stream.h"

namespace duet {

// The policy's name in rows; their task is kWalkRows (rows/groups/row_groups.h).
inline constexpr const char* kVelocityPolicy = "velocity";

// The upper body stays in the neutral pose, in one drawn for the episode, or moves between poses drawn for it.
enum class UpperBody { kStill, kHeld, kMoving };

struct SuiteReference {
  std::string name;                                    // in rows the clip; once per suite
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // forward, to the left [m/s], yaw rate [rad/s], in the heading
  double seconds = 14.0;                               // of the episode
  double begin = 0.0, end = 14.0;                      // when the command holds; else the root stands [s]
  double pause = 0.0;                                  // above 0: on and off in turn, each for so long [s]
  UpperBody upper_body = UpperBody::kStill;
  Tags tags = {};  // of its rows (core/episode_tags.h); they change nothing of an episode

  // Whether the command holds from the first tick to the last.
  [[nodiscard]] bool constant() const { return begin <= 0.0 && end >= seconds && pause <= 0.0; }
};

// A mapping or a list of them. Throws InputError: file, line, expected, found.
std::vector<SuiteReference> read_references(const YamlSection& suite, const std::string& file);
std::string references_yaml(const std::vector<SuiteReference>& references);  // a block; "" where there are none

// The reference by its name; throws std::invalid_argument with those that are there.
const SuiteReference& reference_of(const std::vector<SuiteReference>& references, const std::string& name);

StreamOptions stream_options(const SuiteReference& reference);

// A controller that takes a velocity by its option `command` gets the reference's, unless the suite gives it one.
bool takes_command(const ControllerInfo& controller);
ControllerOptions with_command(const ControllerInfo& controller, ControllerOptions options,
                               const SuiteReference& reference);

}  // namespace duet
