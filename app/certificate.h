// The parity certificate of `duet validate`: what each engine measured in the scenes of the conformance suite, with the
// verdicts and the asserted deviations, as JSON (schema duet.certificate/1, docs/file-formats.md). Its digest covers
// all but itself, the time it was made at and the costs, so that the same program on the same machine makes the same
// digest.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "duet/backends/conformance/conformance.h"

namespace duet {

struct CertifiedMeasurement {
  conformance::Measurement found;
  conformance::CheckStatus verdict = conformance::CheckStatus::kFail;
};

// Error against cost of one scene, coarsest step first.
struct AccuracyCurve {
  std::string scene, error, unit;
  std::vector<conformance::AccuracyPoint> points;
};

struct CertifiedEngine {
  std::string name, version, profile;
  double dt = 0.0;        // [s]
  EngineOptions options;  // as the profile names them
  conformance::Tally tally;
  std::vector<CertifiedMeasurement> measurements;
  std::vector<AccuracyCurve> accuracy;
};

struct CertifiedDeviation {
  std::string engine, scene, quantity, reason;
  double bound = 0.0;
};

struct Certificate {
  std::string effort;      // "quick", "full"
  std::string created_at;  // UTC, ISO 8601
  std::string program;     // version of duet
  std::string machine;
  std::vector<CertifiedEngine> engines;
  std::vector<CertifiedDeviation> deviations;  // of its engines
  std::string digest;                          // SHA-256, lower-case hex
};

// `reports` after conformance::agree; `profile` is the name of the one that they ran under.
Certificate certify(std::span<const conformance::EngineReport> reports, const std::string& profile,
                    const std::string& created_at);

nlohmann::json certificate_json(const Certificate& certificate);

// Throws InputError, one sentence with the path: not readable, no JSON, another schema, a missing, unknown or wrongly
// typed key, counts that are not those of the verdicts, a digest that does not match the content.
Certificate load_certificate(const std::string& path);

// The page of a parity certificate: error against cost of each scene, and every measurement. Self-contained (no
// network, no script needed), light and dark. Form of the plots: SimBenchmark.

// `style`: the style sheet of pages, load_viewer("report"); plain without it.
std::string parity_page(const Certificate& certificate, const std::string& style);

// Four of the scenes as one picture that stands alone, for a README or a paper; "" where none of them was run.
std::string parity_svg(const Certificate& certificate);

// One scene, log-log, engines as colours, step sizes as dots; "" where no engine has a positive error and cost.
std::string accuracy_plot_svg(const std::vector<CertifiedEngine>& engines, const std::string& scene);

}  // namespace duet
