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

}  // namespace

template <>
const JsonSchema<CertifiedMeasurement>& json_schema<CertifiedMeasurement>() {
  using M = Measurement;
  static const JsonSchema<M> found = {{{"scene"}, &M::scene},
                                      {{"quantity"}, &M::quantity},
                                      {{"unit"}, &M::unit},
                                      {finite_key("dt"), &M::dt},
                                      {{"value"}, &M::value},
                                      {{"expected"}, &M::expected},
                                      {{"tolerance"}, &M::tolerance},
                                      {{"relative"}, &M::relative},
                                      {{"across_engines"}, &M::across_engines},
                                      {{"note"}, &M::note}};
  static const JsonSchema<CertifiedMeasurement> schema = [] {
    JsonSchema<CertifiedMeasurement> keys = json_keys(&CertifiedMeasurement::found, found);
    keys.emplace_back(FieldDoc{.name = "verdict", .choices = {"pass", "FAIL", "deviation", "unsupported"}},
                      &CertifiedMeasurement::verdict);
    return keys;
  }();
  return schema;
}

template <>
const JsonSchema<AccuracyPoint>& json_schema<AccuracyPoint>() {
  using P = AccuracyPoint;
  static const JsonSchema<P> schema = {
      {finite_key("dt"), &P::dt}, {finite_key("error"), &P::error}, {finite_key("cost"), &P::cost}};
  return schema;
}

template <>
const JsonSchema<AccuracyCurve>& json_schema<AccuracyCurve>() {
  using C = AccuracyCurve;
  static const JsonSchema<C> schema = {
      {{"scene"}, &C::scene}, {{"error"}, &C::error}, {{"unit"}, &C::unit}, {{"points"}, &C::points}};
  return schema;
}

template <>
const JsonSchema<CertifiedEngine>& json_schema<CertifiedEngine>() {
  using E = CertifiedEngine;
  static const JsonSchema<Tally> tally = {
      {{"passed"}, &Tally::passed},
      {{"failed"}, &Tally::failed},
      {{"deviations"}, &Tally::deviations},
      {{.name = "unsupported", .optional = true},
       "integer",
       [](const Tally& found) { return found.unsupported > 0 ? json(found.unsupported) : json(); },
       [](const JsonNode& node, Tally& found) { read_json(node, {}, found.unsupported); }}};
  static const JsonSchema<E> schema = [] {
    JsonSchema<E> keys = json_keys(&E::tally, tally);
    const JsonSchema<E> others = {{{"name"}, &E::name},        {{"version"}, &E::version},
                                  {{"profile"}, &E::profile},  {finite_key("dt"), &E::dt},
                                  {{"options"}, &E::options},  {{"measurements"}, &E::measurements},
                                  {{"accuracy"}, &E::accuracy}};
    keys.insert(keys.end(), others.begin(), others.end());
    return keys;
  }();
  return schema;
}

template <>
const JsonSchema<CertifiedDeviation>& json_schema<CertifiedDeviation>() {
  using D = CertifiedDeviation;
  static const JsonSchema<D> schema = {{{"engine"}, &D::engine},
                                       {{"scene"}, &D::scene},
                                       {{"quantity"}, &D::quantity},
                                       {{"reason"}, &D::reason},
                                       {finite_key("bound"), &D::bound}};
  return schema;
}

template <>
const JsonSchema<Certificate>& json_schema<Certificate>() {
  using C = Certificate;
  static const JsonSchema<C> schema = {{{"effort"}, &C::effort},   {{"created_at"}, &C::created_at},
                                       {{"program"}, &C::program}, {{"machine"}, &C::machine},
                                       {{"engines"}, &C::engines}, {{"deviations"}, &C::deviations},
                                       {{"digest"}, &C::digest}};
  return schema;
}

namespace {

std::string digest_of(const Certificate& certificate) {
  json content = certificate_json(certificate);
  content.erase("created_at");
  content.erase("digest");
  for (json& engine : content["engines"])
    for (json& curve : engine["accuracy"])
      for (json& point : curve["points"]) point.erase("cost");
  return sha256_hex(dumped(content));
}

void check_tally(const CertifiedEngine& engine, const std::string& what) {
  Tally counted;
  for (const CertifiedMeasurement& measurement : engine.measurements) counted.count(measurement.verdict);
  if (counted == engine.tally) return;
  const Tally& said = engine.tally;
  throw InputError(
      fmt::format("{}: engine '{}' says {} passed, {} failed, {} deviations, {} unsupported; its measurements are {}, "
                  "{}, {}, {}",
                  what, excerpt(engine.name), said.passed, said.failed, said.deviations, said.unsupported,
                  counted.passed, counted.failed, counted.deviations, counted.unsupported));
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

json certificate_json(const Certificate& certificate) { return json_document(kSchema, certificate); }

Certificate load_certificate(const std::string& path) {
  const std::string what = fmt::format("certificate '{}'", path);
  auto certificate = read_document<Certificate>(read_text(path), what, kSchema);
  for (CertifiedEngine& engine : certificate.engines) {
    check_tally(engine, what);
    for (CertifiedMeasurement& measurement : engine.measurements)
      measurement.found.unsupported = measurement.verdict == conformance::CheckStatus::kUnsupported;
  }
  if (const std::string digest = digest_of(certificate); digest != certificate.digest)
    throw InputError(
        fmt::format("{}: its digest is {:.12}, its content has {:.12}: it was edited after `duet validate` "
                    "wrote it",
                    what, certificate.digest, digest));
  return certificate;
}

}  // namespace duet
