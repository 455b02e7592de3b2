// Where two rows differ that should be of one and the same episode. An episode repeats bit for bit, so equal rows agree
// in every field that does not measure wall time; what is compared is their JSON, so that a new field is compared too.
#pragma once

#include <string>
#include <vector>

#include "duet/results/rows/episode_row.h"

namespace duet {

struct FieldDifference {
  std::string field;          // "success", "metrics.jpe", "verdicts.0.values.distance"
  std::string first, second;  // the values as JSON; "nothing" where one has no such field; a long one is cut
};

// Of all fields that repeat (episode_row.h); the others tell when and how fast an episode ran. NaN equals NaN; two
// values of numbers are equal where they are the same number.
std::vector<FieldDifference> row_differences(const EpisodeRow& first, const EpisodeRow& second);

// Their names alone; none: the rows are equal.
std::vector<std::string> differing_fields(const EpisodeRow& first, const EpisodeRow& second);

// "success: true, false; metrics.jpe: 0.1, 0.2" of a few, those of the row itself first, and how many more there are.
std::string differences_text(std::vector<FieldDifference> differences);

}  // namespace duet
