// Words of what networks' files say of themselves: lists of joints and numbers, as makers spell them.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace duet {

using Metadata = std::map<std::string, std::string>;  // of an ONNX file, by key

// "a,b", ["a", "b"], (a b): the words between commas, brackets, quotes and spaces.
std::vector<std::string> metadata_words(const std::string& text);

// A joint's name without case, "_joint", "_link", "-" for "_": the same joint under the names of two makers.
std::string plain_joint(std::string name);

// The physics step of the simulation in which a network's makers trained it, where its file says (holosoma's
// `experiment_config`) [s].
std::optional<double> physics_step_of(const Metadata& metadata);

}  // namespace duet
