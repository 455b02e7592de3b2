// Positions of joints in CSV: a line of names "<joint>_x", "<joint>_y", "<joint>_z", one line a frame. Two people stand
// in one file with "a_" and "b_" (or "p1_", "p2_", "person1_", "person2_") before each name. Thread-safe.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/recording.h"

namespace duet {

struct PositionsCsv {
  std::vector<std::string> joints;
  bool two_people = false;
  std::array<PointTracks, 2> tracks;  // the second empty where there is one person
  double rate_hz = 0.0;               // of a column "time" in seconds; 0 without one
  bool uneven = false;                // the times are not even: the tracks are, along lines between the file's frames
};

// An empty field and "nan" are NaN. Throws InputError naming file, line and column: no names, an axis that is missing,
// a joint that is there twice or for one person only, a field that is no number, lines of different length, times that
// do not go on evenly (to a tenth of a period) or, where `longest_step` [s] is told, a step that is longer, and more
// than half of the frames missing.
PositionsCsv parse_positions_csv(std::string_view text, const std::string& name,
                                 std::optional<double> longest_step = std::nullopt);

// Whether the table begins with names of which half or more are joints' axes: it is of people, whatever is wrong with
// it further down. `text`: the file or its beginning. Throws nothing.
bool names_positions(std::string_view text);

// Whether the first line names joints of two people (true), of one (false); throws InputError for neither.
bool csv_has_two_people(std::string_view text, const std::string& name);

}  // namespace duet
