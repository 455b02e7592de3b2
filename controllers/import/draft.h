// An IO descriptor as it is imported: what a file of a network's makers says, with the place that each part comes from.
// Internal to controllers/import.
#pragma once

#include <yaml-cpp/yaml.h>

#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/controllers/descriptor.h"
#include "duet/controllers/metadata.h"
#include "duet/robots/robot_model.h"

namespace duet {

// A term of the makers' observation, as channels of a descriptor: "base_angular_velocity, scale: 0.25".
struct DraftTerm {
  std::string name;
  std::vector<std::string> channels{};
  int frames = 1;
};

struct Draft {
  std::string kind;       // "holosoma", ...
  std::string network{};  // file name that the file gives; "": none
  std::string card{};     // of the body whose joints stand for motors without names; "": joints have names
  double rate_hz = kTickRate;
  std::optional<double> dt{};                     // physics step of its simulation [s]
  std::vector<DescriptorJoint> joints{};          // in the network's order
  std::vector<DraftTerm> terms{};                 // in the order of the input
  bool frame_major = false, starts_full = false;  // of its history
  bool frames_seen = false, has_clock = false;    // whether a term has a history, a clock
  double action_clip = std::numeric_limits<double>::infinity();
  std::optional<VelocityInterface> command{};
  std::map<std::string, std::string> from{};  // by key of the descriptor: the place that it comes from
  std::vector<std::string> assumed{};         // sentences
};

// A card that has all of a network's joints.
struct DraftBody {
  std::string card;  // name or path
  std::shared_ptr<const RobotModel> robot;
};

// The facts of a term that change its channels.
struct TermFacts {
  std::vector<double> scale = {1.0};
  double clip = std::numeric_limits<double>::infinity();
  std::string clock{};   // keys of a gait's clock: "frequency_hz: 1, ..."
  std::string anchor{};  // frame of a tracker's errors
  bool clipped = false;  // of the previous action
};

// The channels of a term under any of its makers' names. Throws InputError with the nearest and all known names.
DraftTerm draft_term(const std::string& name, const TermFacts& facts, const std::string& file);

// The body of joints under the makers' names: the card asked for, else of those that have all of them the one with most
// of the very names, then with the fewest others. Throws InputError where none has.
DraftBody body_of(const std::vector<std::string>& joints, const std::string& card, const std::string& file);
// The body of so many joints whose file names none: the card asked for, else the first of as many, the one that a
// folder of `path` names before all others, then those of the robot that stands in.
DraftBody body_of(std::size_t joints, const std::string& card, const std::string& file, const std::string& path);
// The robot's joint under a maker's name: without case, "_joint", "-" for "_"; -1: none.
int joint_of(const RobotModel& robot, const std::string& name);

// A number that a file may write as 2.0. Throws InputError: `key` and file, the bounds, what was found.
int whole_number(double value, int least, int most, const std::string& key, const std::string& file);
inline constexpr int kMostFrames = 1000;  // of a history

// The draft of what an ONNX file says of itself. Throws InputError where it says too little, and of what.
Draft draft_of_metadata(const Metadata& metadata, const std::string& file, const std::string& card);

// The draft of a deployment's YAML; `metadata`: of its network, for the names of joints where it has none.
Draft draft_of_deployment(const YAML::Node& document, const std::string& file, const std::string& card,
                          const Metadata& metadata);

}  // namespace duet
