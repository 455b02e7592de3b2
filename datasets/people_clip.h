// A recording of others as a clip of one of duet's tasks: which task it is, from what the user says, the data set's
// label, or what the detectors see on the two people.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

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

// Facts that the recordings of one source share, before each is judged: which labels they carry, and how steady the
// bones of its tracker are. Deterministic: it depends on the recordings alone.

struct SourceFacts {
  std::map<std::string, int> labels = {};  // recordings by label ("": none); those that cannot be read are left out
  double bone_change = 0.0;                // median of limb_bone_change() over a sample; 0: too few recordings

  // Recordings of several acts: one task for all of them cannot be meant.
  [[nodiscard]] bool is_mixed() const { return labels.size() > 1; }
};

// How many recordings have each label. Reads them all.
std::map<std::string, int> count_labels(const PeopleFormat& format, const std::vector<ClipPlace>& places,
                                        const PeopleOptions& options, int threads);

// Measured on at most 32 recordings, evenly spaced; 0 for fewer than five that can be read. Two significant digits.
double usual_bone_change(const PeopleFormat& format, const std::vector<ClipPlace>& places, const PeopleOptions& options,
                         int threads);

}  // namespace duet
