#include "metrics/spectrum.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "core/require.h"

namespace duet {
namespace {

constexpr Eigen::Index kWelchSegment = 256;
constexpr Eigen::Index kFilterPadding = 15;  // scipy's default for a fourth-order filter: three times five taps

// A real signal's bins other than zero and Nyquist stand for two of the full transform.
BandEnergy fourier_energy(const Eigen::VectorXd& x, double rate_hz, double cutoff_hz, EdgeBin edge) {
  const Eigen::Index n = x.size();
  if (n == 1) return {0.0, x.squaredNorm()};  // the transform needs two samples; one is all mean
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  Eigen::VectorXcd bins;
  fft.fwd(bins, x);
  BandEnergy energy;
  for (Eigen::Index k = 0; k <= n / 2; ++k) {
    const bool single = k == 0 || 2 * k == n;
    const double bin = std::norm(bins[k]) * (single ? 1.0 : 2.0) / static_cast<double>(n);
    // k rate / n against the cut-off, without the rounding of a division.
    const double frequency = static_cast<double>(k) * rate_hz;
    const double limit = cutoff_hz * static_cast<double>(n);
    energy.total += bin;
    if (edge == EdgeBin::kAbove ? frequency > limit : frequency >= limit) energy.high += bin;
  }
  return energy;
}

Eigen::VectorXd hann(Eigen::Index n) {
  if (n == 1) return Eigen::VectorXd::Ones(1);
  Eigen::VectorXd window(n);
  for (Eigen::Index i = 0; i < n; ++i)
    window[i] = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n - 1));
  return window;
}

BandEnergy welch_energy(const Eigen::VectorXd& x, double rate_hz, double cutoff_hz, EdgeBin edge) {
  const Eigen::Index length = std::min(kWelchSegment, x.size());
  const Eigen::Index step = std::max<Eigen::Index>(1, length - length / 2);
  const Eigen::VectorXd window = hann(length);
  BandEnergy sum;
  for (Eigen::Index begin = 0; begin + length <= x.size(); begin += step) {
    const BandEnergy segment = fourier_energy(x.segment(begin, length).cwiseProduct(window), rate_hz, cutoff_hz, edge);
    sum.high += segment.high;
    sum.total += segment.total;
  }
  return sum;
}

// Second-order high-pass section, transposed direct form II.
class HighPassSection {
 public:
  // `k` is tan(pi cutoff / rate) (bilinear transform with prewarping), `q` the section's quality.
  HighPassSection(double k, double q)
      : b0_(1.0 / (1.0 + k / q + k * k)), a1_(2.0 * (k * k - 1.0) * b0_), a2_((1.0 - k / q + k * k) * b0_) {}

  // The state after a constant input of this value for ever; the output is then zero.
  void settle(double input) {
    z1_ = -b0_ * input;
    z2_ = b0_ * input;
  }
  double step(double x) {
    const double y = b0_ * x + z1_;
    z1_ = -2.0 * b0_ * x - a1_ * y + z2_;
    z2_ = b0_ * x - a2_ * y;
    return y;
  }

 private:
  double b0_, a1_, a2_;
  double z1_ = 0.0, z2_ = 0.0;
};

// Fourth order, from rest at its first sample's value.
void high_pass(Eigen::VectorXd& x, double k) {
  const std::array<double, 2> angles = {std::numbers::pi / 8.0, 3.0 * std::numbers::pi / 8.0};
  HighPassSection first(k, 0.5 / std::cos(angles[0]));
  HighPassSection second(k, 0.5 / std::cos(angles[1]));
  first.settle(x[0]);
  for (double& sample : x) sample = second.step(first.step(sample));
}

BandEnergy filtered_energy(const Eigen::VectorXd& x, double rate_hz, double cutoff_hz) {
  require(rate_hz > 2.0 * cutoff_hz,
          fmt::format("butterworth spectrum: a cut-off of {} Hz needs more than {} Hz, found {}", cutoff_hz,
                      2.0 * cutoff_hz, rate_hz));
  const Eigen::Index n = x.size();
  const Eigen::Index padding = std::min(kFilterPadding, n - 1);
  Eigen::VectorXd padded(n + 2 * padding);
  padded << (2.0 * x[0] - x.segment(1, padding).array()).matrix().reverse(), x,
      (2.0 * x[n - 1] - x.segment(n - 1 - padding, padding).array()).matrix().reverse();
  const double k = std::tan(std::numbers::pi * cutoff_hz / rate_hz);
  high_pass(padded, k);
  padded.reverseInPlace();
  high_pass(padded, k);
  return {padded.segment(padding, n).squaredNorm(), x.squaredNorm()};
}

}  // namespace

BandEnergy band_energy(const Eigen::Ref<const Eigen::VectorXd>& x, double rate_hz, double cutoff_hz, Spectrum spectrum,
                       EdgeBin edge) {
  switch (spectrum) {
    case Spectrum::kHann:
      return fourier_energy(x.cwiseProduct(hann(x.size())), rate_hz, cutoff_hz, edge);
    case Spectrum::kWelch:
      return welch_energy(x, rate_hz, cutoff_hz, edge);
    case Spectrum::kButterworth:
      return filtered_energy(x, rate_hz, cutoff_hz);
    case Spectrum::kPeriodogram:
      break;
  }
  return fourier_energy(x, rate_hz, cutoff_hz, edge);
}

}  // namespace duet
