// Several rows of one and the same episode: which of them stands, and where two differ that should not. An episode
// repeats bit for bit, so equal rows agree in every field that does not measure wall time; what is compared is their
// JSON, so that a new field is compared too.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "duet/rows/episode_row.h"

namespace duet {

// Whether an episode came to an end of its own. An error and a time-out are mishaps of a machine or a program: another
// try may end otherwise.
bool has_ended(Outcome outcome);

// Which of two rows of one episode stands, in a folder, in a union and in a merge alike.
enum class Stands {
  kFirst,  // the other one gives way: an error to any other row, a time-out to all but an error, and one of a machine
           // that could not run the episode to one that has
  kSecond,
  kEither,      // two errors, two time-outs or two unsupported: they need not agree
  kBothAgreed,  // both ran to an end: rows that differ in a field that repeats are a fault
};
Stands which_stands(Outcome first, Outcome second);
// Notes, among many rows, the outcome of the one that stands, by key.
void note_outcome(const std::string& key, Outcome outcome, std::map<std::string, Outcome>& outcomes);

struct FieldDifference {
  std::string field;          // "success", "metrics.jpe", "verdicts.0.values.distance"
  std::string first, second;  // the values as JSON; "nothing" where one has no such field; a long one is cut
};

// The differences in fields that repeat (episode_row.h); others tell when and how fast it ran. NaN equals NaN; two
// values of numbers are equal where they are the same number. Tags are compared where both rows have some: rows from
// before there were any have none.
std::vector<FieldDifference> row_differences(const EpisodeRow& first, const EpisodeRow& second);

// Their names alone; none: the rows are equal.
std::vector<std::string> differing_fields(const EpisodeRow& first, const EpisodeRow& second);

// "success: true, false; metrics.jpe: 0.1, 0.2" of a few, those of the row itself first, and how many more there are.
std::string differences_text(std::vector<FieldDifference> differences);

}  // namespace duet
