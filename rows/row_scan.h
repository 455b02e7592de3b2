// The facts of an episode row that a merge needs, found without reading the row: names, digests, key and a fingerprint
// of all that repeats. A row is some thousand bytes, most of them numbers that nobody looks at when rows are united;
// reading them all costs twenty times as much. Thread-safe.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

#include "duet/rows/episode_row.h"

namespace duet {

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
