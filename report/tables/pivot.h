// A table as a pivot of estimates: which keys make a row, and for each column which estimate of the row it shows, how.
// A row stands where its first estimate does; rows of the paper stand last.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/cells.h"
#include "duet/report/tables/estimate.h"
#include "duet/report/tables/text_table.h"

namespace duet {

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
