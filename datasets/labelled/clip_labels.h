// Labels of recordings in a file that a person or a data set's script writes: CSV with the header "clip,label". A label
// is a task's name, a data set's own word for one ("Shake hands"), or any other word: then it is none of the tasks.
#pragma once

#include <map>
#include <string>
#include <string_view>

namespace duet {

using ClipLabels = std::map<std::string, std::string>;  // by the clip's id; "" leaves the clip out

// Throws InputError naming file and line: another header, a wrong number of fields, no clip, a clip twice.
ClipLabels parse_clip_labels(std::string_view text, const std::string& name);
ClipLabels read_clip_labels(const std::string& path);

}  // namespace duet
