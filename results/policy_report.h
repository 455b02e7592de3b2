// All that a report says of policies: what they achieve, what perturbations cost them, whether they react. Each part
// only where the rows have what it needs.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "duet/results/degradation.h"
#include "duet/results/policy_table.h"
#include "duet/results/reactivity.h"

namespace duet {

struct PolicyReport {
  PolicyTable policies;
  Degradation degradation;
  ReactivityTable reactivity;
};

PolicyReport policy_report(const std::vector<EpisodeRow>& rows, const PolicyTableOptions& options = {});

// Markdown of the parts that have anything, each after an empty line; "" for none.
std::string policy_report_text(const PolicyReport& report);

// Names and contents of the files of a format ("md", "csv", "json", "tex"; none for another): "policies.md", ...
std::vector<std::pair<std::string, std::string>> policy_report_files(const PolicyReport& report,
                                                                     const std::string& format);

// "policies", "degradation" and "reactivity", where there are any, added to `json`.
void add_policy_report(const PolicyReport& report, nlohmann::json& json);

}  // namespace duet
