// The part of a suite file that says who acts: controllers and policies, by name or with options.
#pragma once

#include <string>

#include "bench/suite.h"
#include "robots/yaml_section.h"

namespace duet {

// Fill suite.controllers and suite.policies; suite.file is set. Throw InputError (file, line, expected, found).
void read_controllers(const YamlSection& top, Suite& suite);
void read_policies(const YamlSection& top, Suite& suite);

// Throw std::invalid_argument for an unknown controller or policy, or an option that it does not have.
void check_options_of(const SuiteController& controller);
void check_options_of(const SuitePolicy& policy);

// A path of a suite file as an absolute one: relative ones start at the file's folder, or, where nothing is there but
// in the working folder (`-s policies=[my/policy.yaml]`), at that.
std::string from_folder_of(const Suite& suite, const std::string& file);

}  // namespace duet
