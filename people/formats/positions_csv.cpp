#include "duet/people/formats/positions_csv.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "duet/archives/csv.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kEvenTimes = 0.1;   // of a period
constexpr double kMostFrames = 2.0;  // at even times, of those in the file

[[noreturn]] void refuse_csv(const std::string& name, const std::string& fault) {
  throw InputError(fmt::format("'{}': {}", excerpt(name, kShownSentence), fault));
}

struct Column {
  std::string joint;
  int axis = -1;
  int person = 0;
  bool is_time = false;
};

// "wrist_x", "wrist.x", "wrist x", "WristX".
std::optional<std::pair<std::string, int>> joint_and_axis(std::string_view field) {
  if (field.size() < 2) return std::nullopt;
  const char last = field.back(), before = field[field.size() - 2];
  const int axis = std::tolower(static_cast<unsigned char>(last)) - 'x';
  if (axis < 0 || axis > 2) return std::nullopt;
  const bool separated = std::string_view("_.- :").find(before) != std::string_view::npos;
  if (separated) return std::pair{std::string(field.substr(0, field.size() - 2)), axis};
  if (std::isupper(static_cast<unsigned char>(last)) != 0)
    return std::pair{std::string(field.substr(0, field.size() - 1)), axis};
  return std::nullopt;
}

constexpr std::array<std::pair<std::string_view, int>, 10> kPersons = {{{"person1_", 0},
                                                                        {"person2_", 1},
                                                                        {"persona_", 0},
                                                                        {"personb_", 1},
                                                                        {"p1_", 0},
                                                                        {"p2_", 1},
                                                                        {"a_", 0},
                                                                        {"b_", 1},
                                                                        {"0_", 0},
                                                                        {"1_", 1}}};

// Person and what is left of the name; nothing where no person stands before it.
std::optional<std::pair<int, std::string>> person_of(const std::string& joint) {
  std::string lower = joint;
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const auto& [prefix, person] : kPersons)
    if (lower.starts_with(prefix) && lower.size() > prefix.size())
      return std::pair{person, joint.substr(prefix.size())};
  return std::nullopt;
}

struct CsvHeader {
  std::vector<Column> columns;
  bool two_people = false;
};

Column column_of(const std::string& field) {
  Column column;
  column.is_time = field == "time" || field == "t" || field == "Time" || field == "time_s";
  if (const auto found = column.is_time ? std::nullopt : joint_and_axis(field)) {
    column.joint = found->first;
    column.axis = found->second;
  }
  return column;
}

// The header in the row that the reader stands on.
CsvHeader header_of(const CsvReader& row) {
  CsvHeader header;
  for (const std::string& field : row.fields()) header.columns.push_back(column_of(field));
  const auto has_axis = [](const Column& column) { return column.axis >= 0; };
  if (std::none_of(header.columns.begin(), header.columns.end(), has_axis))
    row.fail(fmt::format("expected names like 'left_wrist_x', found '{}'",
                         excerpt(fmt::format("{}", fmt::join(row.fields(), ",")))));
  header.two_people = std::all_of(header.columns.begin(), header.columns.end(), [&](const Column& column) {
    return !has_axis(column) || person_of(column.joint).has_value();
  });
  if (!header.two_people) return header;
  for (Column& column : header.columns) {
    if (column.axis < 0) continue;
    const auto found = person_of(column.joint);
    column.person = found->first;
    column.joint = found->second;
  }
  return header;
}

// Where each column's value goes: person, joint, axis.
class CsvPlaces {
 public:
  CsvPlaces(const CsvHeader& header, const std::string& name) : name_(name) {
    for (const Column& column : header.columns)
      if (column.axis >= 0 && column.person == 0) joint(column.joint);
    for (std::size_t c = 0; c < header.columns.size(); ++c) add(header.columns[c], static_cast<int>(c));
    check(header.two_people ? 2 : 1);
  }
  [[nodiscard]] const std::vector<std::string>& joints() const { return joints_; }
  [[nodiscard]] int column(int person, std::size_t joint, int axis) const {
    return columns_.at({person, static_cast<int>(joint), axis});
  }

 private:
  int joint(const std::string& joint) {
    const auto found = numbers_.find(joint);
    if (found != numbers_.end()) return found->second;
    joints_.push_back(joint);
    return numbers_.emplace(joint, static_cast<int>(joints_.size()) - 1).first->second;
  }
  void add(const Column& column, int c) {
    if (column.axis < 0) return;
    const bool known = numbers_.contains(column.joint);
    if (!known) refuse_csv(name_, fmt::format("joint '{}' stands there for person B only", excerpt(column.joint)));
    if (!columns_.emplace(std::array{column.person, joint(column.joint), column.axis}, c).second)
      refuse_csv(name_, fmt::format("column {}: joint '{}' has this axis twice", c + 1, excerpt(column.joint)));
  }
  void check(int people) const {
    for (int person = 0; person < people; ++person)
      for (std::size_t j = 0; j < joints_.size(); ++j)
        for (int axis = 0; axis < 3; ++axis)
          if (!columns_.contains({person, static_cast<int>(j), axis}))
            refuse_csv(name_, fmt::format("joint '{}' of person {} has no column for {}", excerpt(joints_[j]),
                                          person == 0 ? "A" : "B", "xyz"[axis]));
  }

  const std::string& name_;
  std::vector<std::string> joints_;
  std::map<std::string, int> numbers_;
  std::map<std::array<int, 3>, int> columns_;
};

double number_of(const CsvReader& row, std::size_t column) {
  const std::string& field = row.fields()[column];
  if (field.empty() || field == "nan" || field == "NaN" || field == "NAN")
    return std::numeric_limits<double>::quiet_NaN();
  const std::optional<double> value = row.number(field);
  if (!value) row.fail(fmt::format("column {}: expected a number, found '{}'", column + 1, excerpt(field)));
  return *value;
}

// The rate, and whether the steps are all alike.
std::pair<double, bool> rate_of_times(const std::vector<double>& times, const std::string& name,
                                      std::optional<double> longest_step) {
  if (times.size() < 2) return {0.0, true};
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  const double period = quantile(steps, 0.5);
  if (!(period > 0.0)) refuse_csv(name, "column 'time': expected times that grow");
  bool even = true;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (std::abs(steps[i] - period) <= kEvenTimes * period) continue;
    even = false;
    if (!longest_step || !(steps[i] > 0.0 && steps[i] <= *longest_step))
      refuse_csv(name, fmt::format("column 'time': frame {} comes after {:.4g} s, expected {:.4g} s{}", i + 1, steps[i],
                                   period,
                                   longest_step ? fmt::format(", at most {} s", *longest_step)
                                                : " (--fill-gaps SECONDS puts uneven times in order)"));
  }
  if (const double frames = (times.back() - times.front()) / period;
      frames > kMostFrames * static_cast<double>(times.size()))
    refuse_csv(name, fmt::format("column 'time': {} frames in {:.4g} s, expected {:.0f}, one every {:.4g} s",
                                 times.size(), times.back() - times.front(), frames, period));
  const double mean = even ? static_cast<double>(steps.size()) / (times.back() - times.front()) : 1.0 / period;
  const double whole = std::round(mean);
  return {whole > 0.0 && std::abs(mean - whole) <= 2e-3 * whole ? whole : mean, even};
}

// At even times from the first on, along lines.
PointTracks at_even_times(const PointTracks& tracks, const std::vector<double>& times, double rate_hz) {
  PointTracks even(static_cast<int>(std::floor((times.back() - times.front()) * rate_hz + 1e-6)) + 1, tracks.points());
  int before = 0;
  for (int t = 0; t < even.frames(); ++t) {
    const double time = times.front() + t / rate_hz;
    while (before + 2 < tracks.frames() && times[static_cast<std::size_t>(before) + 1] <= time) ++before;
    const auto at = static_cast<std::size_t>(before);
    const double part = std::clamp((time - times[at]) / (times[at + 1] - times[at]), 0.0, 1.0);
    even.frame(t) = (1.0 - part) * tracks.frame(before) + part * tracks.frame(before + 1);
  }
  return even;
}

}  // namespace

bool names_positions(std::string_view text) {
  CsvReader rows(text, "");
  try {
    if (!rows.next()) return false;
  } catch (const InputError&) {
    return false;
  }
  // A robot's table has a root with axes, too, beside columns of its joints.
  const auto has_axis = [](const std::string& field) { return column_of(field).axis >= 0; };
  return 2 * std::count_if(rows.fields().begin(), rows.fields().end(), has_axis) >= std::ssize(rows.fields());
}

bool csv_has_two_people(std::string_view text, const std::string& name) {
  CsvReader rows(text, name);
  if (!rows.next()) refuse_csv(name, "expected a line of names, found none");
  return header_of(rows).two_people;
}

PositionsCsv parse_positions_csv(std::string_view text, const std::string& name, std::optional<double> longest_step) {
  CsvReader rows(text, name);
  if (!rows.next()) refuse_csv(name, "expected a line of names, found none");
  const CsvHeader header = header_of(rows);
  const CsvPlaces places(header, name);
  std::vector<double> values, times;
  const std::size_t width = header.columns.size();
  std::size_t frames = 0;
  while (rows.next()) {
    if (rows.fields().size() != width)
      rows.fail(fmt::format("expected {} fields, found {}", width, rows.fields().size()));
    for (std::size_t c = 0; c < width; ++c) {
      const Column& column = header.columns[c];
      const bool wanted = column.axis >= 0 || column.is_time;
      values.push_back(wanted ? number_of(rows, c) : 0.0);
      if (column.is_time) times.push_back(values.back());
    }
    ++frames;
  }
  PositionsCsv result{.joints = places.joints(), .two_people = header.two_people, .tracks = {}};
  for (int person = 0; person < (header.two_people ? 2 : 1); ++person) {
    PointTracks& tracks = result.tracks[static_cast<std::size_t>(person)];
    tracks = PointTracks(static_cast<int>(frames), static_cast<int>(result.joints.size()));
    for (std::size_t j = 0; j < result.joints.size(); ++j)
      for (int axis = 0; axis < 3; ++axis) {
        const auto column = static_cast<std::size_t>(places.column(person, j, axis));
        for (std::size_t t = 0; t < frames; ++t)
          tracks.at(static_cast<int>(t), static_cast<int>(j))[axis] = values[t * width + column];
      }
  }
  const auto [rate_hz, even] = rate_of_times(times, name, longest_step);
  result.rate_hz = rate_hz;
  result.uneven = !even;
  for (PointTracks& tracks : result.tracks)
    if (!even && !tracks.empty()) tracks = at_even_times(tracks, times, rate_hz);
  return result;
}

}  // namespace duet
