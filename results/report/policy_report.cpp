#include "duet/results/report/policy_report.h"

namespace duet {

PolicyReport policy_report(const std::vector<EpisodeRow>& rows, const PolicyTableOptions& options) {
  return {policy_table(rows, options), degradation(rows, options), reactivity_table(rows, options)};
}

std::vector<Analysis> policy_analyses(const PolicyReport& report) {
  std::vector<Analysis> analyses;
  if (!report.policies.lines.empty())
    analyses.push_back(analysis_of("policies", report.policies, policy_table_markdown, policy_table_csv,
                                   policy_table_latex, policy_table_json));
  if (!report.degradation.success.empty())
    analyses.push_back(analysis_of("degradation", report.degradation, degradation_markdown, degradation_csv,
                                   degradation_latex, degradation_json));
  if (!report.reactivity.empty())
    analyses.push_back(analysis_of("reactivity", report.reactivity, reactivity_markdown, reactivity_csv,
                                   reactivity_latex, reactivity_json));
  return analyses;
}

std::string policy_report_text(const PolicyReport& report) {
  std::string text;
  for (const Analysis& analysis : policy_analyses(report)) text.append("\n").append(analysis.markdown());
  return text;
}

}  // namespace duet
