#include "duet/metrics/diagnostics.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "duet/core/require.h"
#include "duet/metrics/track_checks.h"

namespace duet {
namespace {

constexpr double kCutoffHz = 5.0;  // Table S4
constexpr Eigen::Index kMinFrames = 4;
// Energy of this share is rounding left by the removed mean, not motion.
constexpr double kRoundoff = 1e-24;

Eigen::MatrixXd joint_velocity(const Eigen::MatrixXd& q, double rate_hz, VelocitySource source,
                               const Eigen::MatrixXd& v) {
  switch (source) {
    case VelocitySource::kGradient:
      return gradient(q, rate_hz);
    case VelocitySource::kGiven:
      require_finite(v, "hf_ratio: v");
      require_same_shape(v, q, "hf_ratio: v", "q");
      return v;
    case VelocitySource::kDiff:
      break;
  }
  return (q.rightCols(q.cols() - 1) - q.leftCols(q.cols() - 1)) * rate_hz;
}

// Both figures of a joint that does not move are 0.
std::vector<BandEnergy> joint_energies(Eigen::MatrixXd velocity, double rate_hz, const DiagnosticReadings& readings) {
  const Eigen::VectorXd raw = velocity.rowwise().squaredNorm();
  if (readings.mean == MeanHandling::kRemove) velocity.colwise() -= velocity.rowwise().mean().eval();
  const Eigen::VectorXd left = velocity.rowwise().squaredNorm();
  std::vector<BandEnergy> energies = band_energies(velocity, rate_hz, kCutoffHz, readings.spectrum, readings.edge);
  for (Eigen::Index j = 0; j < velocity.rows(); ++j)
    if (left[j] <= kRoundoff * raw[j]) energies[j] = {};
  return energies;
}

// Mean over frames and joints of |x|, mean over frames of the norm over joints, or the root of the mean square.
enum class Norm { kMeanAbs, kMeanNorm, kRms };
double reduce(const Eigen::MatrixXd& x, Norm norm) {
  switch (norm) {
    case Norm::kMeanNorm:
      return x.colwise().norm().mean();
    case Norm::kRms:
      return std::sqrt(x.squaredNorm() / static_cast<double>(x.size()));
    case Norm::kMeanAbs:
      break;
  }
  return x.cwiseAbs().mean();
}

Norm norm_of(JerkNorm reading) {
  return reading == JerkNorm::kMeanAbs ? Norm::kMeanAbs : reading == JerkNorm::kMeanNorm ? Norm::kMeanNorm : Norm::kRms;
}
Norm norm_of(DofErrorNorm reading) {
  return reading == DofErrorNorm::kMeanAbs    ? Norm::kMeanAbs
         : reading == DofErrorNorm::kMeanNorm ? Norm::kMeanNorm
                                              : Norm::kRms;
}

double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  const Eigen::Quaterniond relative = a.conjugate() * b;
  return 2.0 * std::atan2(relative.vec().norm(), std::abs(relative.w()));
}

void check_poses(const std::vector<Pose>& poses, const char* name) {
  for (size_t t = 0; t < poses.size(); ++t)
    if (!poses[t].p.allFinite() || !poses[t].R.coeffs().allFinite() || poses[t].R.norm() <= 0.0)
      throw std::invalid_argument(fmt::format("root_error: {} is not a finite pose at frame {}", name, t));
}

// A recording as matrices: executed and reference.
struct Tracking {
  Eigen::MatrixXd q, q_ref, v, v_ref;  // (joints, T)
  Eigen::Matrix3Xd root, root_ref;     // (3, T)
  std::vector<Pose> X_WB, X_WB_ref;
};

Tracking tracking_of(const Recording& recording) {
  const Eigen::Index frames = recording.frames();
  require(frames >= kMinFrames, "controller diagnostics need {} frames or more, found {}", kMinFrames, frames);
  require(static_cast<Eigen::Index>(recording.reference.size()) == frames,
          "controller diagnostics: {} states but {} references", frames, recording.reference.size());
  const Eigen::Index dof = recording.robot.front().q.size();
  Tracking t{Eigen::MatrixXd(dof, frames),
             Eigen::MatrixXd(dof, frames),
             Eigen::MatrixXd(dof, frames),
             {},
             Eigen::Matrix3Xd(3, frames),
             Eigen::Matrix3Xd(3, frames),
             {},
             {}};
  for (Eigen::Index i = 0; i < frames; ++i) {
    const RobotState& state = recording.robot[i];
    const Reference& reference = recording.reference[i];
    if (state.q.size() != dof || state.v.size() != dof || reference.q.size() != dof)
      throw std::invalid_argument(
          fmt::format("controller diagnostics: frame {} has {} joint angles, {} velocities and {} references, "
                      "expected {}",
                      i, state.q.size(), state.v.size(), reference.q.size(), dof));
    t.q.col(i) = state.q;
    t.v.col(i) = state.v;
    t.q_ref.col(i) = reference.q;
    t.root.col(i) = state.X_WB.p;
    t.root_ref.col(i) = reference.X_WB.p;
    t.X_WB.push_back(state.X_WB);
    t.X_WB_ref.push_back(reference.X_WB);
  }
  t.v_ref = gradient(t.q_ref, recording.rate_hz);
  return t;
}

}  // namespace

double hf_ratio(const Eigen::MatrixXd& q, double rate_hz, const DiagnosticReadings& readings,
                const Eigen::MatrixXd& v) {
  require_finite(q, "hf_ratio: q");
  require_sampling(q.cols(), rate_hz, JerkScheme::kDiff, "hf_ratio");
  const Eigen::MatrixXd velocity = joint_velocity(q, rate_hz, readings.velocity, v);
  BandEnergy pooled;
  double ratios = 0.0;
  int moving = 0;
  for (const BandEnergy& energy : joint_energies(velocity, rate_hz, readings)) {
    pooled.high += energy.high;
    pooled.total += energy.total;
    if (energy.total > 0.0) {
      ratios += energy.high / energy.total;
      ++moving;
    }
  }
  if (moving == 0) return std::numeric_limits<double>::quiet_NaN();
  return readings.pool == Pool::kEnergy ? pooled.high / pooled.total : ratios / moving;
}

double dof_jerk(const Eigen::MatrixXd& q, double rate_hz, const DiagnosticReadings& readings) {
  require_finite(q, "dof_jerk: q");
  require_sampling(q.cols(), rate_hz, readings.jerk_scheme, "dof_jerk");
  return reduce(third_derivative(q, rate_hz, readings.jerk_scheme), norm_of(readings.dof_jerk));
}

double root_jerk(const Eigen::Matrix3Xd& p, double rate_hz, const DiagnosticReadings& readings) {
  require_finite(p, "root_jerk: p");
  require_sampling(p.cols(), rate_hz, readings.jerk_scheme, "root_jerk");
  const Eigen::MatrixXd third = third_derivative(p, rate_hz, readings.jerk_scheme);
  const double mean_norm = third.colwise().norm().mean();
  return readings.root_jerk == JerkNorm::kRms ? std::sqrt(third.colwise().squaredNorm().mean()) : mean_norm;
}

RootError root_error(const std::vector<Pose>& X_WB, const std::vector<Pose>& reference) {
  require(!X_WB.empty(), "root_error: X_WB is empty");
  require(X_WB.size() == reference.size(), "root_error: reference has {} frames, but X_WB has {}", reference.size(),
          X_WB.size());
  check_poses(X_WB, "X_WB");
  check_poses(reference, "reference");
  RootError sum;
  for (size_t t = 0; t < X_WB.size(); ++t) {
    const Eigen::Vector3d off = X_WB[t].p - reference[t].p;
    sum.position += off.norm();
    sum.horizontal += off.head<2>().norm();
    sum.vertical += std::abs(off.z());
    sum.angle_deg += angle_between(X_WB[t].R, reference[t].R);
  }
  const auto frames = static_cast<double>(X_WB.size());
  return {.position = sum.position / frames,
          .horizontal = sum.horizontal / frames,
          .vertical = sum.vertical / frames,
          .angle_deg = sum.angle_deg / frames * 180.0 / std::numbers::pi};
}

DofError dof_error(const Eigen::MatrixXd& q, const Eigen::MatrixXd& q_ref, const Eigen::MatrixXd& v,
                   const Eigen::MatrixXd& v_ref, const DiagnosticReadings& readings) {
  require_finite(q, "dof_error: q");
  require_finite(q_ref, "dof_error: q_ref");
  require_finite(v, "dof_error: v");
  require_finite(v_ref, "dof_error: v_ref");
  require_same_shape(q_ref, q, "dof_error: q_ref", "q");
  require_same_shape(v, q, "dof_error: v", "q");
  require_same_shape(v_ref, q, "dof_error: v_ref", "q");
  const Norm norm = norm_of(readings.dof_error);
  return {reduce(q - q_ref, norm), reduce(v - v_ref, norm)};
}

// Frame t is held against the reference of frame t: both belong to the time t / rate_hz.
std::map<std::string, double> controller_diagnostics(const Recording& recording, const DiagnosticReadings& readings) {
  const Tracking t = tracking_of(recording);
  const double rate_hz = recording.rate_hz;
  const RootError root = root_error(t.X_WB, t.X_WB_ref);
  const DofError dof = dof_error(t.q, t.q_ref, t.v, t.v_ref, readings);
  return {{"hf_ratio", hf_ratio(t.q, rate_hz, readings, t.v)},
          {"dof_jerk", dof_jerk(t.q, rate_hz, readings)},
          {"root_jerk", root_jerk(t.root, rate_hz, readings)},
          {"root_error", root.position},
          {"root_angle_error", root.angle_deg},
          {"dof_error", dof.position},
          {"dof_velocity_error", dof.velocity},
          {"hf_ratio_reference", hf_ratio(t.q_ref, rate_hz, readings, t.v_ref)},
          {"dof_jerk_reference", dof_jerk(t.q_ref, rate_hz, readings)},
          {"root_jerk_reference", root_jerk(t.root_ref, rate_hz, readings)}};
}

std::map<std::string, double> root_error_parts(const Recording& recording) {
  const Tracking t = tracking_of(recording);
  const RootError root = root_error(t.X_WB, t.X_WB_ref);
  return {{"root_error.horizontal", root.horizontal}, {"root_error.vertical", root.vertical}};
}

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
