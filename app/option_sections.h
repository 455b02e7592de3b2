// The options of controllers, policies and engines and of synthesis: the rows of their tables, for
// `duet list` and docs/reference.
#pragma once

#include <string>
#include <vector>

#include "duet/core/field.h"
#include "duet/motion/synthesis_options.h"

namespace duet {

struct OptionSection {
  std::string name;            // whose they are
  std::vector<FieldRow> rows;  // `values` is empty where the meaning begins with it
};

std::vector<OptionSection> controller_option_sections();  // of those that ship, as far as they have any
std::vector<OptionSection> policy_option_sections();      // likewise, and of descriptors by their kind
std::vector<OptionSection> engine_option_sections();      // of the engines that are there
std::vector<OptionSection> synth_option_sections();

// Options of `duet synth`, declared once.

// Fields with the widest ranges; check_synthesis_options (motion/synthesis/synthesis.h) narrows by task and manner.
const FieldTable<SynthesisOptions>& synthesis_fields();

}  // namespace duet
