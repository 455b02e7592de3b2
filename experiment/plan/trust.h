// Which programs a suite or a plan would start or talk to, and whether the user allowed it (docs/trust.md): a suite, or
// the run of somebody else, is data until the user says otherwise. Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "duet/experiment/suite/suite.h"

namespace duet {

// A policy of a suite that is a program of its own, or a training of a plan.
struct NamedProgram {
  std::string who;       // "policy 'wave_policy'", "training 'plain-1'"
  std::string file;      // that names it: a descriptor, a plan
  std::string action;    // "runs 'python3 wave_policy.py' in '/folder'" or "connects to 'localhost:7000'"
  bool trusted = false;  // the file lies in a trusted folder
};

// Programs of the suite's policies but those in `skipped`. Throws InputError for a descriptor that is broken.
std::vector<NamedProgram> programs_of(const Suite& suite, const std::vector<std::string>& skipped = {});
// Programs of one policy; none where it is no descriptor, or one of a network.
std::vector<NamedProgram> programs_of(const SuitePolicy& policy);
// A program that `file` names and that runs in the file's folder.
NamedProgram program_in(const std::string& who, const std::string& file, const std::vector<std::string>& command);

// One line for each: "policy 'wave_policy' of FILE runs 'python3 wave_policy.py' in 'FOLDER'".
std::string describe(const NamedProgram& program);

// Throws InputError with the list where there is a program that is neither allowed nor in a trusted folder.
void require_allowed(const std::vector<NamedProgram>& programs, bool allowed);

// Whether a descriptor and the folder that its program runs in both lie in a folder of $DUET_TRUSTED_FOLDERS (absolute
// paths with ':' between them), links followed.
bool in_trusted_folder(const std::string& descriptor);

}  // namespace duet
