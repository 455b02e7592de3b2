// The key `clips` of a suite: what is synthesised or read, in which variants, and how long people stand around it.
#pragma once

#include <string>
#include <vector>

#include "duet/core/field.h"
#include "duet/experiment/suite/suite.h"
#include "duet/robots/yaml_section.h"

namespace duet {

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
