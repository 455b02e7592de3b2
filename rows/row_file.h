// Rows by the million: what no table reads - traces, contacts, digests that were checked, what verdicts are of - stays
// in the file, and is read where it stands when a figure asks for it. Thread-safe.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/named_values.h"
#include "duet/rows/episode_row.h"

namespace duet {

// A line of episodes.jsonl without its traces and contacts, which are not looked into. One frame stands for all of a
// foot trace. Throws InputError as row_from_json.
EpisodeRow row_without_traces(std::string_view line);
// Gives up what no table reads; the line begins at `line_at`.
void make_lean(EpisodeRow& row, std::int64_t line_at);
// A row's tags, and its names of metrics, forces and of what verdicts are of, become those of the pool.
void share_names(EpisodeRow& row, NamePool& pool);

// Where rows that were held lean stand.
class RowFile {
 public:
  RowFile() = default;  // of rows that are whole
  // Throws InputError where it cannot be read.
  explicit RowFile(std::string path);

  // The row's own, or those of its line. Throw InputError: the file is not what it was when the row was read.
  [[nodiscard]] StateTrace trace(const EpisodeRow& row) const;
  [[nodiscard]] FootTrace feet(const EpisodeRow& row) const;

 private:
  struct Open;
  [[nodiscard]] std::string line_of(const EpisodeRow& row) const;

  std::string path_;
  std::shared_ptr<const Open> open_;  // shared: copies of the object read one file
};

// Several rows of one and the same episode: which of them stands, and where two differ that should not. An episode
// repeats bit for bit, so equal rows agree in every field that does not measure wall time; what is compared is their
// JSON, so that a new field is compared too.

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

// The facts of an episode row that a merge needs, found without reading the row: names, digests, key and a fingerprint
// of all that repeats. A row is some thousand bytes, most of them numbers that nobody looks at when rows are united;
// reading them all costs twenty times as much. Thread-safe.

struct ScannedRow {
  // The fields that the table of a row's fields calls scanned: what names the episode and its parts, their digests,
  // key, outcome and started_at; all else as in a new row.
  EpisodeRow row;
  // The hash of the line's bytes but for the values of wall times, under a key that each process draws. Equal: the rows
  // agree in every other field, but for a chance of 2^-128, and nobody can make two rows that are. Different: they may
  // still agree, written in two ways (row_differences knows).
  std::array<unsigned char, 16> fingerprint{};
};

// Throws InputError, as row_from_json words it, for a line that is no JSON object as far as it is looked at (values of
// numbers are not), another schema, a name that is missing or no text, a field that is there twice, and a key that is
// not episode_key of the row.
ScannedRow scan_row(std::string_view line);
// The same into a row that may be of another line: its memory is used again. After a throw it is of neither.
void scan_row(std::string_view line, ScannedRow& scanned);

// The value of a member of a line, as JSON text; empty where there is none. Throws InputError as scan_row.
std::string_view scan_member(std::string_view line, std::string_view name);
// The line with null for a member of each of these names, and [] for one that is a list. Throws InputError as scan_row.
std::string without_members(std::string_view line, std::span<const std::string_view> names);

}  // namespace duet
