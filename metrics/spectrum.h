// How much of a signal's energy lies above a frequency, by four estimates (docs/deviations.md, M19). Thread-safe.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/metrics/readings.h"

namespace duet {

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
