// Phases, task and roles of clips in a file that a person can edit: CSV with a header, one line a clip, times in
// seconds from the clip's beginning. Supplement B.4: what was annotated by hand there is proposed here and corrected by
// hand where it is wrong.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/task.h"
#include "duet/motion/interaction_clip.h"
#include "duet/report/tables/text_table.h"

namespace duet {

struct Annotation {
  std::string clip;
  std::optional<Task> task = {};  // fields that are empty in the file keep what the clip has
  std::optional<Person> reactor = {};
  std::optional<double> act_begin = {}, act_end = {};  // [s]; both or neither
  std::string note = {};
};
using Annotations = std::map<std::string, Annotation>;  // by the clip's id

// "clip,task,reactor,act_begin_s,act_end_s,note". Throws InputError naming file and line: another header, a wrong
// number of fields, a clip twice, an unknown task, an act that ends before it begins, a number that is none.
Annotations parse_annotations(std::string_view text, const std::string& name);
Annotations read_annotations(const std::string& path);
std::string annotations_csv(const std::vector<Annotation>& annotations);

Annotation annotation_of(const InteractionClip& clip);
// Times are rounded to frames and cut to the clip's. Throws InputError for an act outside the clip, naming it.
void annotate(InteractionClip& clip, const Annotation& annotation);

// How far the phases that duet proposes lie from those that are known: synthesis knows the act of every clip that it
// makes (supplement B.4 annotated by hand).

struct PhaseError {
  Task task = Task::kHug;
  double begin = 0.0, end = 0.0;  // proposed minus known [s]
  double overlap = 0.0;           // of the two acts: shared over both together
};

// Errors of `count` clips a task, synthesised from `seed`; their own phases are hidden from the proposal.
std::vector<PhaseError> phase_errors(std::span<const Task> tasks, int count, std::uint64_t seed, int threads);

// Per task and in total: clips, median and 90th percentile of the size of both errors [s], median overlap.
TextTable phase_error_table(std::span<const PhaseError> errors);

}  // namespace duet
