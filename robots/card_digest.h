// Which robot a row was run on. The digest of a robot is of the URDF's bytes and of what its card says with all that it
// extends, in one spelling: comments, the order of keys, the way numbers are written and how keys are spread over files
// do not count. Cards of before that rule had the digest of their own bytes, and published rows carry it: those that
// still say the same keep it.
#pragma once

#include <yaml-cpp/yaml.h>

#include <map>
#include <string>
#include <string_view>

namespace duet {

// Values of a card's keys but `extends` and `urdf`: in one spelling, mappings by key, numbers in the shortest form.
std::map<std::string, std::string> content_of(const YAML::Node& card);

// SHA-256, hex.
std::string robot_digest(std::string_view urdf, const std::map<std::string, std::string>& content);

}  // namespace duet
