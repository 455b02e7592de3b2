// Facts that the recordings of one source share, before each is judged: which labels they carry, and how steady the
// bones of its tracker are. Deterministic: it depends on the recordings alone.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "duet/people/formats/people_formats.h"

namespace duet {

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
