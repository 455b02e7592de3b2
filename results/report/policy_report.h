// All that a report says of policies: what they achieve, what perturbations cost them, whether they react. Each part
// only where the rows have what it needs.
#pragma once

#include <string>
#include <vector>

#include "duet/results/analyses/analysis.h"
#include "duet/results/analyses/degradation.h"
#include "duet/results/analyses/policy_table.h"
#include "duet/results/analyses/reactivity.h"

namespace duet {

struct PolicyReport {
  PolicyTable policies;
  Degradation degradation;
  ReactivityTable reactivity;
};

PolicyReport policy_report(const std::vector<EpisodeRow>& rows, const PolicyTableOptions& options = {});

// "policies", "degradation" and "reactivity", where there are any. They refer to the report.
std::vector<Analysis> policy_analyses(const PolicyReport& report);

// Markdown of the parts that have anything, each after an empty line; "" for none.
std::string policy_report_text(const PolicyReport& report);

}  // namespace duet
