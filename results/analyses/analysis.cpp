#include "duet/results/analyses/analysis.h"

namespace duet {
namespace {

std::string text_of(const Analysis& analysis, const std::string& format) {
  if (format == "md") return analysis.markdown();
  if (format == "csv") return analysis.csv();
  if (format == "tex") return analysis.latex();
  if (format == "json") return analysis.json().dump(2) + "\n";
  return "";
}

}  // namespace

std::vector<std::pair<std::string, std::string>> analysis_files(const std::vector<Analysis>& analyses,
                                                                const std::string& format) {
  std::vector<std::pair<std::string, std::string>> files;
  for (const Analysis& analysis : analyses)
    if (std::string text = text_of(analysis, format); !text.empty())
      files.emplace_back(analysis.name + "." + format, std::move(text));
  return files;
}

void add_analyses(const std::vector<Analysis>& analyses, nlohmann::json& json) {
  for (const Analysis& analysis : analyses) json[analysis.name] = analysis.json();
}

}  // namespace duet
