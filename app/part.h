// The additions of a part (docs/architecture.md, "Parts") to the program: commands, lists, benchmarks. The program
// knows the names of all that parts may add and their place in its help, so that it can say which part a missing one
// belongs to.
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/app/command.h"
#include "duet/app/option_sections.h"

namespace duet {

// An entry of `duet list`.
struct Listed {
  std::string name, detail;
  std::vector<std::string> options = {};  // a line each
  nlohmann::json more = {};               // keys besides, for machines
};

// A line of `duet doctor`.
struct Finding {
  std::string part;
  bool present = false;
  std::string detail;
};

// The words that a command of the core was given, for a part that adds options to it.
struct GivenWords {
  std::vector<std::string> words;
  bool each = false;
  int threads = 1;
};
// Does the command's work where the part's options ask for it; false: they do not.
using Instead = std::function<bool(cli::Session&, const GivenWords&)>;

// Names as in the tables of the program: another is never asked for.
struct Part {
  std::string name;  // "robot", as DUET_PARTS has it
  std::map<std::string, void (*)(CLI::App&, cli::Session&)> commands = {};
  std::map<std::string, Instead (*)(CLI::App& command)> extensions = {};  // of commands of the core
  std::map<std::string, std::vector<Listed> (*)()> lists = {};
  std::map<std::string, std::vector<OptionSection> (*)()> option_lists = {};  // lists that have a page of reference
  std::map<std::string, void (*)(std::vector<Benchmark>&)> benchmarks = {};
  std::vector<Finding> (*findings)() = nullptr;
};

// The parts of this program; it sets them before it reads its command line.
std::vector<Part>& parts();

// The entry of a part under a name in one of the tables above; null where no part has it.
template <typename Table>
typename Table::mapped_type in_parts(Table Part::*table, const std::string& name) {
  for (const Part& part : parts())
    if (const auto found = (part.*table).find(name); found != (part.*table).end()) return found->second;
  return nullptr;
}

// Adds a part's options to a command of the core; what comes back returns false where no part adds any.
Instead added_by_part(const std::string& name, CLI::App& command);

// "`duet hw` belongs to the part 'robot', which this program was built without; ...".
std::string missing_part_message(const std::string& what, const std::string& part);

}  // namespace duet
