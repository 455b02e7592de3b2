// The named readings of what the supplement leaves open (docs/deviations.md): one struct of choices per family, the
// first value of each the default. Text names are those of `duet list readings` ("independent_frame", ...).
#pragma once

#include <string>
#include <vector>

#include "duet/tasks/task_definition.h"

namespace duet {

enum class JpeFrame { kWorld, kPelvis };
enum class AwdEntries { kFull, kOffdiag, kCross, kWithin };
enum class HandMatching {
  kIndependentFrame,
  kSourceFrame,
  kIndependentSequence,
  kSourceSequence,
  kIndependentBottleneck
};
enum class Compare { kLt, kLe };
enum class ZeroDivision { kNan, kZero, kOne };
enum class LargeAngle { kFrameAny, kEntry, kFrameMean, kFrameAll };
enum class AngleStd { kPooled, kMeanOfJoints };
enum class JerkScheme { kDiff, kCentral, kGradient };

struct MetricReadings {
  JpeFrame jpe_frame = JpeFrame::kWorld;
  AwdEntries awd_entries = AwdEntries::kFull;
  HandMatching matching = HandMatching::kIndependentFrame;
  Compare contact_compare = Compare::kLt;
  ZeroDivision zero_division = ZeroDivision::kNan;
  int min_frames = 1;
  LargeAngle large_angle = LargeAngle::kFrameAny;
  AngleStd angle_std = AngleStd::kPooled;
  int ddof = 0;
  JerkScheme jerk_scheme = JerkScheme::kDiff;
};

enum class VelocitySource { kDiff, kGradient, kGiven };
enum class Spectrum { kPeriodogram, kHann, kWelch, kButterworth };
enum class MeanHandling { kKeep, kRemove };
enum class EdgeBin { kAbove, kAtOrAbove };
enum class Pool { kEnergy, kMeanOfJoints };
enum class JerkNorm { kMeanAbs, kMeanNorm, kRms };  // root_jerk: kMeanNorm (default) or kRms
enum class DofErrorNorm { kMeanAbs, kMeanNorm, kRms };

struct DiagnosticReadings {
  VelocitySource velocity = VelocitySource::kDiff;
  Spectrum spectrum = Spectrum::kPeriodogram;
  MeanHandling mean = MeanHandling::kKeep;
  EdgeBin edge = EdgeBin::kAbove;
  Pool pool = Pool::kEnergy;
  JerkNorm dof_jerk = JerkNorm::kMeanAbs;
  JerkNorm root_jerk = JerkNorm::kMeanNorm;
  JerkScheme jerk_scheme = JerkScheme::kDiff;
  DofErrorNorm dof_error = DofErrorNorm::kMeanAbs;
};

struct Readings {
  MetricReadings metrics;
  DetectorReadings detectors;
  DiagnosticReadings diagnostics;
};

// Sets "family.option" (families: metrics, hug, handshake, high_five, wave, bend, fly_kiss, diagnostics; options as in
// `duet list readings`) to a reading by its text name. Throws std::invalid_argument for an unknown option or reading
// and lists the known ones. Numbers are written as such: "metrics.ddof" takes "0" or "1", "metrics.min_frames" every
// whole number from 1 on (reading_values then names only the default).
void set_reading(Readings& readings, const std::string& option, const std::string& value);
std::string reading(const Readings& readings, const std::string& option);
std::vector<std::string> reading_names();                            // every "family.option"
std::vector<std::string> reading_values(const std::string& option);  // default first

// Readings as the strict set of thresholds wants them (bend forward, fly-kiss after_closest), others as given.
DetectorReadings strict_readings(DetectorReadings readings);

}  // namespace duet
