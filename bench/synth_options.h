// What `duet synth` may be told, declared once.
#pragma once

#include "duet/core/field.h"
#include "duet/motion/synthesis_options.h"

namespace duet {

// With the widest ranges: check_synthesis_options (motion/synthesis.h) knows what a task and a manner narrow.
const FieldTable<SynthesisOptions>& synthesis_fields();

}  // namespace duet
