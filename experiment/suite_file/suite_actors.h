// The part of a suite file that says who acts: controllers and policies, by name or with options.
#pragma once

#include <string>
#include <vector>

#include "duet/core/field.h"
#include "duet/experiment/suite/suite.h"
#include "duet/robots/yaml_section.h"

namespace duet {

// Fill suite.controllers and suite.policies; suite.file is set. Throw InputError (file, line, expected, found).
void read_controllers(const YamlSection& top, Suite& suite);
void read_policies(const YamlSection& top, Suite& suite);

// Their values in the resolved form; a plain controller or policy is its name.
std::string controllers_yaml(const Suite& suite);
std::string policies_yaml(const Suite& suite);

// Throw std::invalid_argument for an unknown controller or policy, or an option that it does not have.
void check_options_of(const SuiteController& controller);
void check_options_of(const SuitePolicy& policy);

// Sets one option of one of the suite's controllers or policies. Throws std::invalid_argument for a name or an option
// that is not known, with those that are.
void set_controller_option(Suite& suite, const std::string& controller, const std::string& option,
                           const std::string& value);
void set_policy_option(Suite& suite, const std::string& policy, const std::string& option, const std::string& value);

// A path of a suite file as an absolute one: relative ones start at the file's folder, or, where nothing is there but
// in the working folder (`-s policies=[my/policy.yaml]`), at that.
std::string from_folder_of(const Suite& suite, const std::string& file);

// The key `clips` of a suite: what is synthesised or read, in which variants, and how long people stand around it.

// Fields of clips.synth and clips.pad.
const FieldTable<SuiteClips>& synth_fields();
const FieldTable<ClipPadding>& padding_fields();
const Field<SuiteClips>& roles_field();

// Fills suite.clips; suite.file is set. Throws InputError: file, line, expected, found.
void read_clips(const YamlSection& top, Suite& suite);
// That each task of the suite can give what a variant asks for.
void check_variants(const YamlSection& top, const Suite& suite);
std::string clips_yaml(const SuiteClips& clips);

}  // namespace duet
