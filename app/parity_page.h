// The page of a parity certificate: error against cost of each scene, and every measurement. Self-contained (no
// network, no script needed), light and dark. Form of the plots: SimBenchmark.
#pragma once

#include <string>
#include <vector>

#include "duet/app/certificate.h"

namespace duet {

// `style`: the style sheet of pages, load_viewer("report"); plain without it.
std::string parity_page(const Certificate& certificate, const std::string& style);

// Four of the scenes as one picture that stands alone, for a README or a paper; "" where none of them was run.
std::string parity_svg(const Certificate& certificate);

// One scene, log-log, engines as colours, step sizes as dots; "" where no engine has a positive error and cost.
std::string accuracy_plot_svg(const std::vector<CertifiedEngine>& engines, const std::string& scene);

}  // namespace duet
