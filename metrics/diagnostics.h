// Controller-space jitter diagnostics (supplement A.4.6, Table S4).
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/metrics/readings.h"

namespace duet {

// (joints, T) [rad] at rate_hz; `v` (same shape, rad/s) only for VelocitySource::kGiven. Fraction in [0, 1].
double hf_ratio(const Eigen::MatrixXd& q, double rate_hz = 50.0, const DiagnosticReadings& readings = {},
                const Eigen::MatrixXd& v = {});
double dof_jerk(const Eigen::MatrixXd& q, double rate_hz = 50.0, const DiagnosticReadings& readings = {});  // [rad/s^3]
double root_jerk(const Eigen::Matrix3Xd& p, double rate_hz = 50.0, const DiagnosticReadings& readings = {});  // [m/s^3]

struct RootError {
  double position = 0.0;    // e_root [m]
  double horizontal = 0.0;  // of it along the floor, and its size along z: a reference that floats has the second [m]
  double vertical = 0.0;
  double angle_deg = 0.0;
};
RootError root_error(const std::vector<Pose>& X_WB, const std::vector<Pose>& reference);

struct DofError {
  double position = 0.0;  // [rad]
  double velocity = 0.0;  // [rad/s]
};
DofError dof_error(const Eigen::MatrixXd& q, const Eigen::MatrixXd& q_ref, const Eigen::MatrixXd& v,
                   const Eigen::MatrixXd& v_ref, const DiagnosticReadings& readings = {});

// Diagnostics by catalogue name: hf_ratio, dof_jerk, root_jerk, root_error, root_angle_error, dof_error,
// dof_velocity_error (executed against reference), and hf_ratio_reference, dof_jerk_reference, root_jerk_reference
// (before the controller). Joint velocity of the reference by central differences. Needs 4 frames or more.
std::map<std::string, double> controller_diagnostics(const Recording& recording,
                                                     const DiagnosticReadings& readings = {});
// e_root's parts, "root_error.horizontal" and "root_error.vertical": printed beside it; rows do not have them.
std::map<std::string, double> root_error_parts(const Recording& recording);

// How much of a signal's energy lies above a frequency, by four estimates (docs/deviations.md, M19). Thread-safe.

struct BandEnergy {
  double high = 0.0;   // above the cut-off
  double total = 0.0;  // 0 <= high <= total but for rounding
};

// Energies of each row of `x`, uniformly sampled at `rate_hz`. The mean is not removed.
//   kPeriodogram  the discrete Fourier transform of all samples; total is the sum of squares (Parseval)
//   kHann         the same after a symmetric Hann window (numpy.hanning)
//   kWelch        summed over segments of 256 samples (all of a shorter signal) that overlap by half, each under that
//                 window and not detrended; what remains at the end is left out
//   kButterworth  energy after a fourth-order high-pass run forwards and backwards (zero phase; scipy's filtfilt with
//                 its odd extension by 15 samples): a quarter of the power remains at the cut-off. Needs a rate of more
//                 than twice the cut-off
// A bin exactly at the cut-off belongs to the high band only with kAtOrAbove (not used by kButterworth).
std::vector<BandEnergy> band_energies(const Eigen::MatrixXd& x, double rate_hz, double cutoff_hz, Spectrum spectrum,
                                      EdgeBin edge);

}  // namespace duet
