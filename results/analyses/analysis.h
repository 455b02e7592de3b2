// One analysis in every form that a report has: what it is called, and how it is written in each. A new analysis is one
// entry in a list; files, JSON and text follow.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace duet {

struct Analysis {
  std::string name;  // of its files and of its member in JSON: "policies"
  std::function<std::string()> markdown, csv, latex;
  std::function<nlohmann::json()> json;
};

// Of a result and its four functions; refers to the result.
template <typename Result>
Analysis analysis_of(const std::string& name, const Result& result, std::string (*markdown)(const Result&),
                     std::string (*csv)(const Result&), std::string (*latex)(const Result&),
                     nlohmann::json (*json)(const Result&)) {
  return {.name = name,
          .markdown = [&result, markdown] { return markdown(result); },
          .csv = [&result, csv] { return csv(result); },
          .latex = [&result, latex] { return latex(result); },
          .json = [&result, json] { return json(result); }};
}

// Names and contents of the files of a format ("md", "csv", "json", "tex"; none for another): "policies.md", ...
std::vector<std::pair<std::string, std::string>> analysis_files(const std::vector<Analysis>& analyses,
                                                                const std::string& format);

// Each under its name, added to `json`.
void add_analyses(const std::vector<Analysis>& analyses, nlohmann::json& json);

}  // namespace duet
