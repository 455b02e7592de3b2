// Curves over time: of trainings, and of a walking controller's feet.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/line_plot.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/row_file.h"

namespace duet {

// Training curves: a CSV whose first line names the columns, whose first column is what the others are drawn against
// ("steps,minutes,return,falls"), one line per moment.

struct TrainingCurves {
  std::string title;                        // how the report calls it: the file's path
  std::vector<std::string> columns;         // the first is the axis
  std::vector<std::vector<double>> values;  // per column; NaN where a cell is empty or "nan"
};

// `name` stands in messages. Throws InputError (file, line, column, expected, found): fewer than two columns, a name
// that is empty or there twice, a line with another number of cells, a cell that is not a number, no line of values.
TrainingCurves parse_curves(std::string_view csv, const std::string& name);
TrainingCurves load_curves(const std::string& path);

// One plot per column that says something: not the axis, not "minutes" (a second clock), not one value throughout.
std::vector<LinePlot> curve_plots(const TrainingCurves& curves);

// Whether a controller lifts its feet: heights of both soles over time.

// Plots one episode of each controller that has one: of its first by task, clip and number, one that ended well and was
// clean before others.
// `file`: where the feet of lean rows are.
std::vector<LinePlot> foot_plots(const std::vector<EpisodeRow>& rows, const RowFile& file = {});

}  // namespace duet
