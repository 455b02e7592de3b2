// Whether a controller lifts its feet: heights of both soles over time.
#pragma once

#include <vector>

#include "duet/report/tables/line_plot.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/row_file.h"

namespace duet {

// Plots one episode of each controller that has one: of its first by task, clip and number, one that ended well and was
// clean before others.
// `file`: where the feet of lean rows are.
std::vector<LinePlot> foot_plots(const std::vector<EpisodeRow>& rows, const RowFile& file = {});

}  // namespace duet
