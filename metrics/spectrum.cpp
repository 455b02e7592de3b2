#include "duet/metrics/spectrum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr Eigen::Index kWelchSegment = 256;
constexpr Eigen::Index kFilterPadding = 15;  // scipy's default for a fourth-order filter: three times five taps

// Bins that belong to the low band: 0 to this, not included. k rate / n is held against the cut-off without the
// rounding of a division.
Eigen::Index low_bins(Eigen::Index n, double rate_hz, double cutoff_hz, EdgeBin edge) {
  const double limit = cutoff_hz * static_cast<double>(n);
  Eigen::Index bins = 0;
  while (bins <= n / 2) {
    const double frequency = static_cast<double>(bins) * rate_hz;
    if (edge == EdgeBin::kAbove ? frequency > limit : frequency >= limit) break;
    ++bins;
  }
  return bins;
}

// cos and sin of 2 pi k t / n for bins [begin, end) as columns, cosines first. The table keeps arguments small.
Eigen::MatrixXd fourier_basis(Eigen::Index n, Eigen::Index begin, Eigen::Index end) {
  Eigen::VectorXd cosine(n), sine(n);
  for (Eigen::Index t = 0; t < n; ++t) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(t) / static_cast<double>(n);
    cosine[t] = std::cos(angle);
    sine[t] = std::sin(angle);
  }
  const Eigen::Index bins = end - begin;
  Eigen::MatrixXd basis(n, 2 * bins);
  for (Eigen::Index k = 0; k < bins; ++k) {
    for (Eigen::Index t = 0; t < n; ++t) {
      const Eigen::Index place = (begin + k) * t % n;
      basis(t, k) = cosine[place];
      basis(t, bins + k) = sine[place];
    }
  }
  return basis;
}

// x * y. Eigen cuts a deep product into panels by the size of the machine's first cache, and with them the order of the
// sums. These are its panels for 32 KiB, which every x86-64 processor has: so the bits are the same on all of them.
Eigen::MatrixXd product_in_panels(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y) {
  constexpr Eigen::Index kDeepest = 504, kPeeled = 8;
  const Eigen::Index depth = x.cols(), over = depth % kDeepest;
  Eigen::Index panel = kDeepest;
  if (depth > kDeepest && over != 0) panel -= kPeeled * ((kDeepest - 1 - over) / (kPeeled * (depth / kDeepest + 1)));
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(x.rows(), y.cols());
  for (Eigen::Index begin = 0; begin < depth; begin += panel) {
    const Eigen::Index count = std::min(panel, depth - begin);
    product.noalias() += x.middleCols(begin, count) * y.middleRows(begin, count);
  }
  return product;
}

// Adds the energies of each row. Only the few bins of the low band are transformed; the rest is what the sum of squares
// has left (Parseval). A real signal's bins other than zero and Nyquist stand for two of the full transform.
void add_fourier_energy(const Eigen::MatrixXd& x, double rate_hz, double cutoff_hz, EdgeBin edge,
                        std::vector<BandEnergy>& energies) {
  constexpr Eigen::Index kBlock = 64;  // bounds the basis in memory
  const Eigen::Index n = x.cols();
  const Eigen::Index bins = low_bins(n, rate_hz, cutoff_hz, edge);
  Eigen::VectorXd low = Eigen::VectorXd::Zero(x.rows());
  for (Eigen::Index begin = 0; begin < bins; begin += kBlock) {
    const Eigen::Index count = std::min(kBlock, bins - begin);
    const Eigen::MatrixXd parts = product_in_panels(x, fourier_basis(n, begin, begin + count));
    for (Eigen::Index k = 0; k < count; ++k) {
      const bool single = begin + k == 0 || 2 * (begin + k) == n;
      low += (parts.col(k).cwiseAbs2() + parts.col(count + k).cwiseAbs2()) *
             ((single ? 1.0 : 2.0) / static_cast<double>(n));
    }
  }
  for (Eigen::Index j = 0; j < x.rows(); ++j) {
    const double total = x.row(j).squaredNorm();
    energies[j].total += total;
    energies[j].high += std::max(0.0, total - low[j]);
  }
}

Eigen::VectorXd hann(Eigen::Index n) {
  if (n == 1) return Eigen::VectorXd::Ones(1);
  Eigen::VectorXd window(n);
  for (Eigen::Index i = 0; i < n; ++i)
    window[i] = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n - 1));
  return window;
}

void add_welch_energy(const Eigen::MatrixXd& x, double rate_hz, double cutoff_hz, EdgeBin edge,
                      std::vector<BandEnergy>& energies) {
  const Eigen::Index length = std::min(kWelchSegment, x.cols());
  const Eigen::Index step = std::max<Eigen::Index>(1, length - length / 2);
  const Eigen::VectorXd window = hann(length);
  for (Eigen::Index begin = 0; begin + length <= x.cols(); begin += step)
    add_fourier_energy(x.middleCols(begin, length) * window.asDiagonal(), rate_hz, cutoff_hz, edge, energies);
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
  require(rate_hz > 2.0 * cutoff_hz, "butterworth spectrum: a cut-off of {} Hz needs more than {} Hz, found {}",
          cutoff_hz, 2.0 * cutoff_hz, rate_hz);
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

std::vector<BandEnergy> band_energies(const Eigen::MatrixXd& x, double rate_hz, double cutoff_hz, Spectrum spectrum,
                                      EdgeBin edge) {
  std::vector<BandEnergy> energies(x.rows());
  switch (spectrum) {
    case Spectrum::kPeriodogram:
      add_fourier_energy(x, rate_hz, cutoff_hz, edge, energies);
      break;
    case Spectrum::kHann:
      add_fourier_energy(x * hann(x.cols()).asDiagonal(), rate_hz, cutoff_hz, edge, energies);
      break;
    case Spectrum::kWelch:
      add_welch_energy(x, rate_hz, cutoff_hz, edge, energies);
      break;
    case Spectrum::kButterworth:
      for (Eigen::Index j = 0; j < x.rows(); ++j) energies[j] = filtered_energy(x.row(j), rate_hz, cutoff_hz);
      break;
  }
  return energies;
}

}  // namespace duet
