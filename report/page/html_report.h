// The HTML report: opens from disk, no network. All its tables stand in it as tables, for readers without a script,
// too; viewer/src/report.ts makes them sortable and searchable and draws plots from the data of the page: schema
// `duet.report/1`, with figures as `duet report -f json` writes them (docs/file-formats.md, "Report page").
#pragma once

#include <string>

#include "duet/report/page/html_page.h"
#include "duet/report/page/report_content.h"

namespace duet {

// `viewer`: load_viewer("report"), or an empty one for plain tables.
std::string html_report(const ReportContent& content, const ViewerBundle& viewer);

}  // namespace duet
