// The version of the detectors' code stands for what they say of fixed motions: where that changes, it must be raised,
// as rows of two versions are never in one table.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "duet/core/digest.h"
#include "duet/core/task.h"
#include "duet/metrics/detector.h"
#include "tests/metrics/acting.h"

namespace duet {
namespace {

constexpr std::string_view kVersion = "1";
constexpr std::string_view kDigest = "57079e6c75754bab9c5e3b72d82295494c41bf49dd078ee2748b5fd49df21e47";

// Sines differ in the last bits between libraries; six decimals do not.
std::string rounded(double value) { return fmt::format("{:.6f}", std::abs(value) < 5e-7 ? 0.0 : value); }

std::string text_of(const DetectorResult& result) {
  std::string text = result.success ? "success" : "failure";
  for (const auto& [name, holds] : result.parts) text += fmt::format(" {}={}", name, holds);
  for (const auto& [name, value] : result.values) text += fmt::format(" {}={}", name, rounded(value));
  for (const auto& [name, margin] : result.margins) text += fmt::format(" {}={}", name, rounded(margin));
  for (const bool frame : result.frames) text += frame ? '1' : '0';
  return text + "\n";
}

std::string verdicts_of_fixed_motions() {
  std::string text;
  for (const Task task : kPaperTasks) {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
      const test::Scene scene = test::acting(task, seed);
      for (const DetectorVersion version : {DetectorVersion::kPaper, DetectorVersion::kRobot})
        for (const ThresholdSet set : {ThresholdSet::kPaper, ThresholdSet::kStrict})
          text += fmt::format("{} {} {}", to_string(task), seed,
                              text_of(detect(task, scene.partner, scene.performer, version, set)));
    }
  }
  return text;
}

TEST(DetectorsVersion, StandsForTheseVerdicts) {
  EXPECT_EQ(sha256_hex(verdicts_of_fixed_motions()), kDigest)
      << "the detectors' output changed: raise kDetectorsVersion (metrics/detector.h) and take the new digest here, "
         "together";
  EXPECT_EQ(kDetectorsVersion, kVersion);
}

TEST(DetectorsVersion, FixedMotionsSucceedAndFail) {
  const std::string text = verdicts_of_fixed_motions();
  for (const Task task : kPaperTasks) {
    const std::string name(to_string(task));
    int successes = 0, failures = 0;
    for (std::size_t at = 0; (at = text.find(name + " ", at)) != std::string::npos; ++at) {
      const std::string line = text.substr(at, text.find('\n', at) - at);
      line.find("success ") != std::string::npos ? ++successes : ++failures;
    }
    EXPECT_GT(successes, 5) << name;
    EXPECT_GT(failures, 5) << name;
  }
}

}  // namespace
}  // namespace duet
