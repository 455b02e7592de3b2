#include "duet/report/engines/certificate_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace duet {
namespace {

constexpr const char* kSchema = "duet.certificate/1";
constexpr const char* kTitle = "Parity certificate";

std::string text_of(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "-";
}

// A number, or how many a list or an object has.
std::string count_of(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) return "-";
  if (found->is_number_integer()) return dumped(*found);
  return found->is_structured() ? fmt::format("{}", found->size()) : "-";
}

std::vector<nlohmann::json> engines_in(const nlohmann::json& certificate) {
  std::vector<nlohmann::json> engines;
  const auto found = certificate.find("engines");
  if (found == certificate.end() || !found->is_array()) return engines;
  std::copy_if(found->begin(), found->end(), std::back_inserter(engines),
               [](const nlohmann::json& engine) { return engine.is_object(); });
  return engines;
}

// Which engines of the results the certificate does not cover as they were run.
std::vector<std::string> coverage_notes(const std::vector<nlohmann::json>& certified,
                                        const std::vector<RunEngine>& engines) {
  std::vector<std::string> missing;
  std::vector<std::string> notes;
  for (const RunEngine& engine : engines) {
    const auto found = std::find_if(certified.begin(), certified.end(),
                                    [&](const nlohmann::json& entry) { return text_of(entry, "name") == engine.name; });
    if (found == certified.end()) {
      missing.push_back(engine.name);
      continue;
    }
    const std::string version = text_of(*found, "version");
    const std::string profile = text_of(*found, "profile");
    const bool same_version = engine.version.empty() || engine.version == version;
    const bool same_profile = engine.profile.empty() || engine.profile == profile;
    if (same_version && same_profile) continue;
    notes.push_back(fmt::format("These results are of {} {} with profile {}, the certificate of {} with profile {}.",
                                engine.name, engine.version, engine.profile, version, profile));
  }
  if (!missing.empty()) notes.push_back(fmt::format("The certificate does not cover {}.", fmt::join(missing, ", ")));
  return notes;
}

}  // namespace

TitledTable certificate_table(const nlohmann::json& certificate, const std::vector<RunEngine>& engines) {
  TitledTable titled{.title = kTitle};
  if (!certificate.is_object()) {
    titled.notes = {certificate.is_null() ? "No parity certificate is attached (duet validate makes one)."
                                          : "The parity certificate attached is no JSON object and is not shown."};
    return titled;
  }
  titled.caption = fmt::format("Effort {}, made {}, digest {:.12}.", text_of(certificate, "effort"),
                               text_of(certificate, "created_at"), text_of(certificate, "digest"));
  titled.table = {.header = {"Engine", "Version", "Profile", "Checks passed", "Asserted deviations", "Failed"},
                  .rows = {},
                  .label_columns = 3};
  const std::vector<nlohmann::json> certified = engines_in(certificate);
  for (const nlohmann::json& engine : certified) {
    titled.table.rows.push_back({text_of(engine, "name"), text_of(engine, "version"), text_of(engine, "profile"),
                                 count_of(engine, "passed"), count_of(engine, "deviations"),
                                 count_of(engine, "failed")});
  }
  titled.notes = {certified.empty() ? "It names no engine."
                                    : "An asserted deviation is a known difference that the suite of scenes expects, "
                                      "with its reason."};
  if (const std::string schema = text_of(certificate, "schema"); schema != kSchema) {
    titled.notes.push_back(
        fmt::format("Its schema is {}, expected {}: it may say more than is shown.", schema, kSchema));
  }
  for (std::string& note : coverage_notes(certified, engines)) titled.notes.push_back(std::move(note));
  return titled;
}

}  // namespace duet
