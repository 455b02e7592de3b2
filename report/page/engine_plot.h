// Success in each engine as an SVG that stands alone, for a README or a paper; the page of a report shows it, too.
#pragma once

#include <string>

#include "duet/report/engines/cross_engine.h"

namespace duet {

// For each controller and policy a line per engine with its dot and interval, the mean over engines as a bar through
// them, on the shade of the mean's interval; playback hollow. Follows the reader's light or dark scheme. Only axes for
// fewer than two engines.
std::string engine_plot_svg(const CrossEngine& result);

}  // namespace duet
