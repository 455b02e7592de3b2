// A recording of others as a clip of one of duet's tasks: which task it is, from what the user says, the data set's
// label, or what the detectors see on the two people.
#pragma once

#include <optional>
#include <string>

#include "duet/motion/people/source_clip.h"
#include "duet/people/formats/people_formats.h"

namespace duet {

struct PeopleClip {
  std::optional<SourceClip> source;  // none: its label is none of duet's tasks
  std::string label;                 // the data set's, where it has one
};

// Throws InputError: what the format's reader refuses; no task's detector sees its task on people without a label
// (names the option that settles it).
PeopleClip read_people_clip(const PeopleFormat& format, const ClipPlace& place, const PeopleOptions& options);

// The data set's label of a recording; "" where it has none. Throws InputError: what the format's reader refuses.
std::string label_of(const PeopleFormat& format, const ClipPlace& place, const PeopleOptions& options);

}  // namespace duet
