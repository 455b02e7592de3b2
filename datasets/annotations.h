// Phases, task and roles of clips in a file that a person can edit: CSV with a header, one line a clip, times in
// seconds from the clip's beginning. Supplement B.4: what was annotated by hand there is proposed here and corrected by
// hand where it is wrong.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/motion/interaction_clip.h"

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

}  // namespace duet
