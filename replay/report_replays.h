// The replays that a report leads to: pages beside it, of the clips on which engines and policies agree least.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "duet/replay/replay_page.h"
#include "duet/replay/replay_source.h"
#include "duet/report/page/report_content.h"

namespace duet {

// Calls `write` with the name ("replay.html", "replay-2.html") and the text of each page. Throws as replay_of_run.
std::vector<ReportReplay> report_replays(const Run& run, const ReplayChoice& choice, const ViewerBundle& viewer,
                                         const std::function<void(const std::string&, const std::string&)>& write,
                                         Progress& progress);

}  // namespace duet
