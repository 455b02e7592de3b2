#include "results/golden.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <map>

#include "core/require.h"
#include "results/json_fields.h"

namespace duet {
namespace {

constexpr const char* kSchema = "duet.golden/1";
// A mean over episodes moves by this much between processors (vector width, library versions), far less than a change
// of behaviour moves it. Whoever keeps a baseline edits the file where a figure needs another tolerance.
constexpr double kMetricRtol = 0.02;
constexpr double kMetricAtol = 1e-9;

struct Figure {
  double value = 0.0, atol = 0.0, rtol = 0.0;
  [[nodiscard]] double tolerance() const { return atol + rtol * std::abs(value); }
};

std::string place(const LeaderboardEntry& entry) {
  const std::string arm = entry.arm == "main" ? "" : fmt::format(" ({} arm)", entry.arm);
  return fmt::format("{}/{}/{}{} {} {}", entry.engine, entry.controller, entry.policy, arm, entry.perturbation,
                     entry.task);
}

// Everything that a baseline holds of an entry, by name.
std::map<std::string, Figure> figures_of(const LeaderboardEntry& entry) {
  std::map<std::string, Figure> figures;
  figures["episodes"] = {.value = static_cast<double>(entry.n)};
  // One episode may fall on the other side of a threshold on another processor.
  figures["success"] = {.value = entry.success, .atol = entry.n > 0 ? 1.0 / static_cast<double>(entry.n) + 1e-12 : 0.0};
  for (const auto& [name, mean] : entry.metrics) {
    if (std::isfinite(mean)) figures[name] = {.value = mean, .atol = kMetricAtol, .rtol = kMetricRtol};
  }
  return figures;
}

std::map<std::string, Figure> read_figures(const nlohmann::json& json, const std::string& where) {
  if (!json.is_object())
    throw InputError(fmt::format("{}: expected an object of figures, found {}", where, json.type_name()));
  std::map<std::string, Figure> figures;
  for (const auto& [name, value] : json.items()) {
    JsonFields fields(value, fmt::format("{}: {}", where, name));
    const Figure figure{.value = fields.number("value"), .atol = fields.number("atol"), .rtol = fields.number("rtol")};
    fields.refuse_unknown();
    if (figure.atol < 0.0 || figure.rtol < 0.0) {
      throw InputError(fmt::format("{}: {}: expected tolerances of at least 0, found atol {}, rtol {}", where, name,
                                   figure.atol, figure.rtol));
    }
    figures[name] = figure;
  }
  return figures;
}

std::map<std::string, std::map<std::string, Figure>> read_baseline(const std::string& text, const std::string& suite,
                                                                   const std::string& suite_version) {
  const std::string what = "golden baseline";
  const nlohmann::json json = parse_json(text, what);
  JsonFields fields(json, what);
  if (const std::string schema = fields.text("schema"); schema != kSchema) {
    throw InputError(fmt::format("{}: expected schema {}, found {}", what, kSchema, schema));
  }
  const std::string of_suite = fields.text("suite");
  const std::string of_version = fields.text("suite_version");
  if (of_suite != suite || of_version != suite_version) {
    throw InputError(
        fmt::format("{}: is of suite {}@{}, the run of {}@{}", what, of_suite, of_version, suite, suite_version));
  }
  const nlohmann::json& entries = fields.at("entries");
  fields.refuse_unknown();
  if (!entries.is_object()) throw InputError(fmt::format("{}: key 'entries': expected an object", what));
  std::map<std::string, std::map<std::string, Figure>> baseline;
  for (const auto& [where, figures] : entries.items()) {
    baseline[where] = read_figures(figures, fmt::format("{}: {}", what, where));
  }
  return baseline;
}

}  // namespace

std::string bless(const std::vector<LeaderboardEntry>& entries, const std::string& suite,
                  const std::string& suite_version) {
  nlohmann::json list = nlohmann::json::object();
  for (const LeaderboardEntry& entry : entries) {
    nlohmann::json& figures = list[place(entry)];
    for (const auto& [name, figure] : figures_of(entry)) {
      figures[name] = {{"value", figure.value}, {"atol", figure.atol}, {"rtol", figure.rtol}};
    }
  }
  const nlohmann::json json = {
      {"schema", kSchema}, {"suite", suite}, {"suite_version", suite_version}, {"entries", std::move(list)}};
  return json.dump(2) + "\n";
}

std::vector<GoldenDifference> check(const std::string& golden_json, const std::vector<LeaderboardEntry>& entries,
                                    const std::string& suite, const std::string& suite_version) {
  std::map<std::string, std::map<std::string, Figure>> found;
  for (const LeaderboardEntry& entry : entries) found[place(entry)] = figures_of(entry);
  std::vector<GoldenDifference> differences;
  for (const auto& [where, figures] : read_baseline(golden_json, suite, suite_version)) {
    const std::map<std::string, Figure>& run = found[where];
    for (const auto& [name, figure] : figures) {
      GoldenDifference difference{.where = fmt::format("{} {}", where, name),
                                  .expected = figure.value,
                                  .found = std::numeric_limits<double>::quiet_NaN(),
                                  .tolerance = figure.tolerance(),
                                  .missing = true};
      if (const auto value = run.find(name); value != run.end()) {
        difference.found = value->second.value;
        difference.missing = false;
      }
      const bool agrees = std::abs(difference.found - difference.expected) <= difference.tolerance;
      if (!agrees) differences.push_back(std::move(difference));
    }
  }
  return differences;
}

}  // namespace duet
