// The self-contained HTML report: opens from disk, no network; interval bars, loss curves, key frames as stick figures.
#pragma once

#include <string>

#include "duet/report/page/report_content.h"

namespace duet {

std::string html_report(const ReportContent& content);

}  // namespace duet
