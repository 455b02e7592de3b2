// Two-person clips of a task made from nothing: approach on foot, act, part. Phases and contact windows are
// exact by construction. The same arguments give the same bytes on every run.
#pragma once

#include <map>
#include <string>

#include "duet/motion/interaction_clip.h"
#include "duet/motion/synthesis_options.h"

namespace duet {

// Throws std::invalid_argument for an option out of its range, naming it and the range.
void check_synthesis_options(Task task, const SynthesisOptions& options);
// Checks them.
InteractionClip synthesize(Task task, const SynthesisOptions& options);

// The first word of the ids of such clips.
std::string_view synthetic_manner(Likeness like);

// Whether a clip's `source` says that synthesize() made it.
bool is_synthesised(const std::map<std::string, std::string>& source);

}  // namespace duet
