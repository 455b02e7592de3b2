// An estimate in the long form (tidy data) that CSV and JSON have: what it is of, what it is called, its value, what it
// is over and its interval. An analysis is a list of them; its tables are pivots of that list (estimate.h). The columns
// are the same for every analysis, so that their files may be joined. Nothing is rounded.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/text_table.h"
#include "duet/statistics/statistics.h"

namespace duet {

// A share of episodes with its Wilson interval.
struct Rate {
  long n = 0, k = 0;
  double rate = std::numeric_limits<double>::quiet_NaN();  // NaN where n is 0
  Interval interval = kNoInterval;
};
Rate make_rate(long k, long n, double level);

struct Estimate {
  // The keys; "" where one does not apply. An estimate of two names both: "bullet vs mujoco". "all": of all
  // tasks, or of all physics engines, together.
  std::string source = "duet";  // or "paper": as the supplement prints it
  std::string engine = {}, controller = {}, policy = {}, arm = {}, perturbation = {}, task = {};
  std::string of = {};  // what else tells it apart: a metric, a force, a region, a level, a variant, a command
  std::string name = {}, unit = "1";
  std::optional<long> n = {}, k = {};  // how many it is over; of them those that count, where it is a share
  double value = std::numeric_limits<double>::quiet_NaN();  // NaN: not defined
  Interval interval = kNoInterval;
  std::string text = {};  // in the place of a value where it is a word
};

using Estimates = std::vector<Estimate>;

// Estimates with the same keys, one after another.
struct EstimatesOf {
  Estimate keys;
  Estimates& into;

  void add(std::string_view name, std::optional<long> n, double value, const Interval& interval = kNoInterval,
           std::string_view unit = "1") const;
  void rate(std::string_view name, const Rate& rate) const;
  void count(std::string_view name, std::optional<long> n, long count) const;
  void word(std::string_view name, const std::string& text) const;
};

// A line per estimate; `analysis` and the level of intervals are columns, too. Empty where an estimate has no such
// value.
std::string estimates_csv(std::string_view analysis, double level, const Estimates& estimates);

// A list of objects with the names of those columns, but `analysis` and `level`; what is empty is left out, a value
// that is not defined is null.
nlohmann::json estimates_json(const Estimates& estimates);

// A table as a pivot of estimates: which keys make a row, and for each column which estimate of the row it shows, how.
// A row stands where its first estimate does; rows of the paper stand last.

using EstimateKey = std::string Estimate::*;

// The first of this name, of `of`, and of each other key that is not empty in `like`; null where there is none.
const Estimate* find_estimate(const Estimates& estimates, const Estimate& like);

// The estimates of one row.
struct PivotRow {
  std::vector<const Estimate*> estimates;
  bool by_of = false;  // `of` is a key of rows

  [[nodiscard]] const Estimate& keys() const { return *estimates.front(); }
  // As find_estimate; where `of` tells rows apart, an empty one fits any.
  [[nodiscard]] const Estimate* find(const Estimate& like) const;
  [[nodiscard]] double value(const Estimate& like) const;  // NaN where there is none
};

// A column that tells rows apart. It gives way to the caption where all rows have the same, unless `always` is set;
// an estimate without a key that is always shown is in no row, unless it is the paper's.
struct RowLabel {
  const char* title;  // null: tells rows apart and is not shown
  EstimateKey key;
  bool always = false;
  std::string (*text)(const Estimate& keys) = nullptr;  // label_text where it is null
};
// "Hug" of a task, "dstar (shuffled arm)", "D-STAR (the paper's)"; any other key as it is.
std::string label_text(const Estimate& keys, EstimateKey key);
std::string policy_title(const Estimate& keys);
// Engine and controller as far as they differ, and policy; more of them after these.
std::vector<RowLabel> policy_rows(std::vector<RowLabel> more = {});
// The task, always shown.
inline constexpr RowLabel kTaskLabel = {"Task", &Estimate::task, true};

using CellText = std::function<std::string(const Estimate& estimate)>;
struct PivotColumn {
  std::string title;
  std::function<std::string(const PivotRow& row)> cell;
};
// Shows the estimate that `like` names; `missing` where there is none.
PivotColumn column(std::string title, Estimate like, CellText cell, std::string missing = "-");

std::string as_percent(const Estimate& estimate);  // "84.9 [77.6, 90.1]"
std::string as_share(const Estimate& estimate);    // "84.9"
std::string as_points(const Estimate& estimate);   // "+12.3 [4.5, 20.1]"
std::string as_count(const Estimate& estimate);    // the value, whole
std::string as_n(const Estimate& estimate);        // what it is over
std::string as_k(const Estimate& estimate);        // those of them that count
std::string as_p(const Estimate& estimate);
std::string as_word(const Estimate& estimate);
std::string as_significant(const Estimate& estimate);
std::string as_k_of_n(const Estimate& estimate);      // "3/4"; "-" over nothing
std::string as_count_of_n(const Estimate& estimate);  // likewise, of a count
CellText as_decimals(int digits);                     // with the interval
CellText as_short(int most_decimals = 3);             // short_number, with the interval

struct Pivot {
  std::string title;
  std::vector<RowLabel> rows;
  std::vector<PivotColumn> columns;
  std::vector<std::string> notes = {};
};
TitledTable table_of(const Estimates& estimates, const Pivot& pivot);
std::vector<PivotRow> rows_of(const Estimates& estimates, const std::vector<RowLabel>& labels);

// Different values of a key, in the order in which they come; those of estimates that have it.
std::vector<std::string> values_of(const Estimates& estimates, EstimateKey key);
// Whether one of this name, and of the keys that are not empty, is a number.
bool has_number(const Estimates& estimates, const Estimate& like);

}  // namespace duet
