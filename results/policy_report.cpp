#include "duet/results/policy_report.h"

namespace duet {
namespace {

struct Part {
  std::string name;
  bool has_any;
  std::string (*markdown)(const PolicyReport&);
  std::string (*csv)(const PolicyReport&);
  std::string (*latex)(const PolicyReport&);
  nlohmann::json (*json)(const PolicyReport&);
};

std::vector<Part> parts_of(const PolicyReport& report) {
  return {{"policies", !report.policies.lines.empty(),
           [](const PolicyReport& of) { return policy_table_markdown(of.policies); },
           [](const PolicyReport& of) { return policy_table_csv(of.policies); },
           [](const PolicyReport& of) { return policy_table_latex(of.policies); },
           [](const PolicyReport& of) { return policy_table_json(of.policies); }},
          {"degradation", !report.degradation.success.empty(),
           [](const PolicyReport& of) { return degradation_markdown(of.degradation); },
           [](const PolicyReport& of) { return degradation_csv(of.degradation); },
           [](const PolicyReport& of) { return degradation_latex(of.degradation); },
           [](const PolicyReport& of) { return degradation_json(of.degradation); }},
          {"reactivity", !report.reactivity.empty(),
           [](const PolicyReport& of) { return reactivity_markdown(of.reactivity); },
           [](const PolicyReport& of) { return reactivity_csv(of.reactivity); },
           [](const PolicyReport& of) { return reactivity_latex(of.reactivity); },
           [](const PolicyReport& of) { return reactivity_json(of.reactivity); }}};
}

std::string text_of(const Part& part, const PolicyReport& report, const std::string& format) {
  if (format == "md") return part.markdown(report);
  if (format == "csv") return part.csv(report);
  if (format == "tex") return part.latex(report);
  if (format == "json") return part.json(report).dump(2) + "\n";
  return "";
}

}  // namespace

PolicyReport policy_report(const std::vector<EpisodeRow>& rows, const PolicyTableOptions& options) {
  return {policy_table(rows, options), degradation(rows, options), reactivity_table(rows, options)};
}

std::string policy_report_text(const PolicyReport& report) {
  std::string text;
  for (const Part& part : parts_of(report))
    if (part.has_any) text.append("\n").append(part.markdown(report));
  return text;
}

std::vector<std::pair<std::string, std::string>> policy_report_files(const PolicyReport& report,
                                                                     const std::string& format) {
  std::vector<std::pair<std::string, std::string>> files;
  for (const Part& part : parts_of(report))
    if (std::string text = part.has_any ? text_of(part, report, format) : ""; !text.empty())
      files.emplace_back(part.name + "." + format, std::move(text));
  return files;
}

void add_policy_report(const PolicyReport& report, nlohmann::json& json) {
  for (const Part& part : parts_of(report))
    if (part.has_any) json[part.name] = part.json(report);
}

}  // namespace duet
