// The suites that ship with duet: found by name (`duet run demo`) and listed with the question that each asks.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "duet/experiment/suite/suite.h"
#include "duet/rows/folder/run_info.h"

namespace duet {

struct ShippedSuite {
  std::string name;           // of the file, without ".yaml"
  std::string version;        // "hhoi-core 2.0.0"
  std::string question;       // the first sentence of the comment that begins the file
  std::int64_t episodes = 0;  // the null arm included, in the engines that this machine has where the suite names none
  bool clips_given = false;   // its clips are those of who runs it: no episode is counted
};

// Names in alphabetical order. Throws MissingError where the folder is not there.
std::vector<std::string> shipped_suite_names();
// Throws what load_suite throws.
ShippedSuite shipped_suite(const std::string& name);

// `suite` where it is a file's path (a file that exists, or it ends in ".yaml" or has a '/'), else the file of the
// suite that ships under this name. Throws std::invalid_argument for an unknown name, with the known ones.
std::string suite_file(const std::string& suite);

// How a run's suite stands to the one that ships under its name, for titles and verdicts. By the hash:
//   "as it ships (45a100d81a17)"
//   "as it ships but for its clips, which were given (fa2f93af8209)"
//   "NOT the suite of that name that ships with this program: it differs in clips, start (0123456789ab)"
// Empty for a name that no suite has that ships, and where those that ship are not on this machine.
std::string shipped_suite_note(const RunInfo& info);
// The suite that ships, where the run's has its name and its hash. Throws what load_suite and suite_hash throw.
std::optional<Suite> shipped_suite_of(const RunInfo& info);

// The first sentence of the comment that begins a YAML file; empty where it begins with none.
std::string first_sentence(const std::string& yaml);

}  // namespace duet
