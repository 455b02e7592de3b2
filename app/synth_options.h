// Options of `duet synth`, declared once.
#pragma once

#include "duet/core/field.h"
#include "duet/motion/synthesis_options.h"

namespace duet {

// Fields with the widest ranges; check_synthesis_options (motion/synthesis/synthesis.h) narrows by task and manner.
const FieldTable<SynthesisOptions>& synthesis_fields();

}  // namespace duet
