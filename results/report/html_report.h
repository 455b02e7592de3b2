// The self-contained HTML report: opens from disk, no network; interval bars, loss curves, key frames as stick figures.
#pragma once

#include <string>
#include <vector>

#include "duet/results/report/report_content.h"

namespace duet {

// Heights of both soles over time in one episode of each controller that has one: of its first by task, clip and
// number, one that ended well and was clean before others.
std::vector<LinePlot> foot_plots(const std::vector<EpisodeRow>& rows);

std::string html_report(const ReportContent& content);

}  // namespace duet
