#include "duet/app/certificate.h"

#include <fmt/format.h>

#include "duet/backends/conformance/conformance.h"
#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/rows/folder/environment.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

using conformance::AccuracyPoint;
using conformance::Measurement;
using conformance::Tally;
using nlohmann::json;

constexpr const char* kSchema = "duet.certificate/1";

CertifiedEngine certified(const conformance::EngineReport& report, const std::string& profile) {
  CertifiedEngine engine{.name = report.engine,
                         .version = report.version,
                         .profile = profile,
                         .dt = report.settings.dt,
                         .options = report.settings.options,
                         .tally = conformance::tally(report),
                         .measurements = {},
                         .accuracy = {}};
  for (const conformance::SceneReport& scene : report.scenes) {
    for (const Measurement& found : scene.run.measurements)
      engine.measurements.push_back({found, conformance::status_of(report.engine, found)});
    if (!scene.run.accuracy.empty())
      engine.accuracy.push_back({scene.name, scene.run.error, scene.run.error_unit, scene.run.accuracy});
  }
  return engine;
}

json measurement_json(const CertifiedMeasurement& entry) {
  const Measurement& found = entry.found;
  return {{"scene", found.scene},
          {"quantity", found.quantity},
          {"unit", found.unit},
          {"dt", found.dt},
          {"value", number_or_null(found.value)},
          {"expected", number_or_null(found.expected)},
          {"tolerance", number_or_null(found.tolerance)},
          {"relative", found.relative},
          {"across_engines", found.across_engines},
          {"note", found.note},
          {"verdict", conformance::to_string(entry.verdict)}};
}

json curve_json(const AccuracyCurve& curve) {
  json points = json::array();
  for (const AccuracyPoint& point : curve.points)
    points.push_back({{"dt", point.dt}, {"error", point.error}, {"cost", point.cost}});
  return {{"scene", curve.scene}, {"error", curve.error}, {"unit", curve.unit}, {"points", points}};
}

json engine_json(const CertifiedEngine& engine) {
  json measurements = json::array(), accuracy = json::array();
  for (const CertifiedMeasurement& entry : engine.measurements) measurements.push_back(measurement_json(entry));
  for (const AccuracyCurve& curve : engine.accuracy) accuracy.push_back(curve_json(curve));
  json object = {{"name", engine.name},           {"version", engine.version},
                 {"profile", engine.profile},     {"dt", engine.dt},
                 {"options", engine.options},     {"passed", engine.tally.passed},
                 {"failed", engine.tally.failed}, {"deviations", engine.tally.deviations},
                 {"measurements", measurements},  {"accuracy", accuracy}};
  if (engine.tally.unsupported > 0) object["unsupported"] = engine.tally.unsupported;
  return object;
}

json deviation_json(const CertifiedDeviation& entry) {
  return {{"engine", entry.engine},
          {"scene", entry.scene},
          {"quantity", entry.quantity},
          {"reason", entry.reason},
          {"bound", entry.bound}};
}

json content_json(const Certificate& certificate) {
  json engines = json::array(), deviations = json::array();
  for (const CertifiedEngine& engine : certificate.engines) engines.push_back(engine_json(engine));
  for (const CertifiedDeviation& entry : certificate.deviations) deviations.push_back(deviation_json(entry));
  return {{"schema", kSchema},
          {"effort", certificate.effort},
          {"created_at", certificate.created_at},
          {"program", certificate.program},
          {"machine", certificate.machine},
          {"engines", engines},
          {"deviations", deviations}};
}

std::string digest_of(const Certificate& certificate) {
  json content = content_json(certificate);
  content.erase("created_at");
  for (json& engine : content["engines"])
    for (json& curve : engine["accuracy"])
      for (json& point : curve["points"]) point.erase("cost");
  return sha256_hex(dumped(content));
}

// Calls read(element, "engines[2]") for each element of the list at `key`.
template <typename Read>
void read_list(JsonFields& fields, const std::string& key, const std::string& what, Read&& read) {
  const json& list = fields.at(key);
  if (!list.is_array())
    throw InputError(fmt::format("{}: key '{}' expects a list, found {}", what, key, list.type_name()));
  for (std::size_t i = 0; i < list.size(); ++i) read(list[i], fmt::format("{}: {}[{}]", what, key, i));
}

conformance::CheckStatus read_status(const std::string& text, const std::string& what) {
  for (const conformance::CheckStatus verdict :
       {conformance::CheckStatus::kPass, conformance::CheckStatus::kFail, conformance::CheckStatus::kDeviation,
        conformance::CheckStatus::kUnsupported})
    if (text == conformance::to_string(verdict)) return verdict;
  throw InputError(
      fmt::format("{}: verdict is '{}', expected pass, FAIL, deviation or unsupported", what, excerpt(text)));
}

CertifiedMeasurement read_measurement(const json& object, const std::string& what) {
  JsonFields fields(object, what);
  CertifiedMeasurement entry;
  entry.found.scene = fields.text("scene");
  entry.found.quantity = fields.text("quantity");
  entry.found.unit = fields.text("unit");
  entry.found.dt = fields.number("dt");
  entry.found.value = fields.number_or_nan("value");
  entry.found.expected = fields.number_or_nan("expected");
  entry.found.tolerance = fields.number_or_nan("tolerance");
  entry.found.relative = fields.boolean("relative");
  entry.found.across_engines = fields.boolean("across_engines");
  entry.found.note = fields.text("note");
  entry.verdict = read_status(fields.text("verdict"), what);
  entry.found.unsupported = entry.verdict == conformance::CheckStatus::kUnsupported;
  fields.refuse_unknown();
  return entry;
}

AccuracyCurve read_curve(const json& object, const std::string& what) {
  JsonFields fields(object, what);
  AccuracyCurve curve{
      .scene = fields.text("scene"), .error = fields.text("error"), .unit = fields.text("unit"), .points = {}};
  read_list(fields, "points", what, [&](const json& element, const std::string& place) {
    JsonFields point(element, place);
    curve.points.push_back({.dt = point.number("dt"), .error = point.number("error"), .cost = point.number("cost")});
    point.refuse_unknown();
  });
  fields.refuse_unknown();
  return curve;
}

EngineOptions read_options(const json& object, const std::string& what) {
  if (!object.is_object())
    throw InputError(fmt::format("{}: key 'options' expects an object, found {}", what, object.type_name()));
  JsonFields fields(object, what + ": options");
  EngineOptions options;
  for (const auto& item : object.items()) options[item.key()] = fields.text(item.key());
  return options;
}

CertifiedEngine read_engine(const json& object, const std::string& what) {
  JsonFields fields(object, what);
  CertifiedEngine engine;
  engine.name = fields.text("name");
  engine.version = fields.text("version");
  engine.profile = fields.text("profile");
  engine.dt = fields.number("dt");
  engine.options = read_options(fields.at("options"), what);
  engine.tally = {.passed = static_cast<int>(fields.integer("passed")),
                  .failed = static_cast<int>(fields.integer("failed")),
                  .deviations = static_cast<int>(fields.integer("deviations")),
                  .unsupported = fields.has("unsupported") ? fields.count("unsupported") : 0};
  Tally counted;
  read_list(fields, "measurements", what, [&](const json& element, const std::string& place) {
    engine.measurements.push_back(read_measurement(element, place));
    counted.count(engine.measurements.back().verdict);
  });
  read_list(fields, "accuracy", what, [&](const json& element, const std::string& place) {
    engine.accuracy.push_back(read_curve(element, place));
  });
  fields.refuse_unknown();
  if (counted != engine.tally)
    throw InputError(
        fmt::format("{}: says {} passed, {} failed, {} deviations, {} unsupported; its measurements are {}, "
                    "{}, {}, {}",
                    what, engine.tally.passed, engine.tally.failed, engine.tally.deviations, engine.tally.unsupported,
                    counted.passed, counted.failed, counted.deviations, counted.unsupported));
  return engine;
}

CertifiedDeviation read_deviation(const json& object, const std::string& what) {
  JsonFields fields(object, what);
  CertifiedDeviation entry{.engine = fields.text("engine"),
                           .scene = fields.text("scene"),
                           .quantity = fields.text("quantity"),
                           .reason = fields.text("reason"),
                           .bound = fields.number("bound")};
  fields.refuse_unknown();
  return entry;
}

}  // namespace

Certificate certify(std::span<const conformance::EngineReport> reports, const std::string& profile,
                    const std::string& created_at) {
  Certificate certificate{.effort = "quick",
                          .created_at = created_at,
                          .program = duet_version(),
                          .machine = describe_machine(),
                          .engines = {},
                          .deviations = {},
                          .digest = ""};
  for (const conformance::EngineReport& report : reports) {
    if (report.settings.effort == conformance::Effort::kFull) certificate.effort = "full";
    certificate.engines.push_back(certified(report, profile));
    for (const EngineDeviation& entry : conformance::deviations(report.engine))
      certificate.deviations.push_back({report.engine, std::string(entry.scene), std::string(entry.quantity),
                                        std::string(entry.reason), entry.bound});
  }
  certificate.digest = digest_of(certificate);
  return certificate;
}

json certificate_json(const Certificate& certificate) {
  json content = content_json(certificate);
  content["digest"] = certificate.digest;
  return content;
}

Certificate load_certificate(const std::string& path) {
  const std::string what = fmt::format("certificate '{}'", path);
  const json document = parse_json(read_text(path), what);
  JsonFields fields(document, what);
  if (const std::string schema = fields.text("schema"); schema != kSchema)
    throw InputError(fmt::format("{}: schema is '{}', expected '{}'", what, excerpt(schema), kSchema));
  Certificate certificate;
  certificate.effort = fields.text("effort");
  certificate.created_at = fields.text("created_at");
  certificate.program = fields.text("program");
  certificate.machine = fields.text("machine");
  certificate.digest = fields.text("digest");
  read_list(fields, "engines", what, [&](const json& element, const std::string& place) {
    certificate.engines.push_back(read_engine(element, place));
  });
  read_list(fields, "deviations", what, [&](const json& element, const std::string& place) {
    certificate.deviations.push_back(read_deviation(element, place));
  });
  fields.refuse_unknown();
  if (const std::string digest = digest_of(certificate); digest != certificate.digest)
    throw InputError(
        fmt::format("{}: its digest is {:.12}, its content has {:.12}: it was edited after `duet validate` "
                    "wrote it",
                    what, certificate.digest, digest));
  return certificate;
}

}  // namespace duet
