#include "duet/metrics/diagnostics.h"

#include <cmath>
#include <complex>
#include <numbers>
#include <set>

#include "duet/core/numbers.h"
#include "duet/metrics/diagnostics.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr Spectrum kSpectra[] = {Spectrum::kPeriodogram, Spectrum::kHann, Spectrum::kWelch, Spectrum::kButterworth};

// One joint at 50 Hz; 501 samples give 500 velocities, 10 s: every tenth of a hertz is a bin.
Eigen::MatrixXd sine(double hz, double amplitude = 1.0, int samples = 501) {
  Eigen::MatrixXd q(1, samples);
  for (int t = 0; t < samples; ++t) q(0, t) = amplitude * std::sin(2.0 * kPi * hz * t / 50.0);
  return q;
}

double ratio(const Eigen::MatrixXd& q, const DiagnosticReadings& readings = {}) { return hf_ratio(q, 50.0, readings); }

TEST(HfRatio, OfPureSinesIsZeroBelowAndOneAbove) {
  for (const Spectrum spectrum : kSpectra) {
    DiagnosticReadings readings;
    readings.spectrum = spectrum;
    const double leak = spectrum == Spectrum::kPeriodogram ? 1e-12 : spectrum == Spectrum::kButterworth ? 0.02 : 1e-4;
    EXPECT_NEAR(ratio(sine(2.0), readings), 0.0, leak) << static_cast<int>(spectrum);
    EXPECT_NEAR(ratio(sine(12.0), readings), 1.0, leak) << static_cast<int>(spectrum);
  }
}

TEST(HfRatio, BinAtTheEdgeReadings) {
  DiagnosticReadings readings;
  EXPECT_NEAR(ratio(sine(5.0), readings), 0.0, 1e-12);
  readings.edge = EdgeBin::kAtOrAbove;
  EXPECT_NEAR(ratio(sine(5.0), readings), 1.0, 1e-12);
  EXPECT_NEAR(ratio(sine(5.1)), 1.0, 1e-12);
  EXPECT_NEAR(ratio(sine(4.9), readings), 0.0, 1e-12);
}

// Velocity amplitudes of differenced sines: 2 A sin(pi f / rate) rate.
// Eigen sums in an order that depends on the first cache of the machine: 32 KiB there, 48 KiB here.
TEST(HfRatio, DoesNotDependOnTheSizeOfCaches) {
  Random random(3, stream_key({"caches"}));
  Eigen::MatrixXd q(29, 1300);
  for (double& value : q.reshaped()) value = random.normal();
  const std::ptrdiff_t first = Eigen::l1CacheSize(), second = Eigen::l2CacheSize(), third = Eigen::l3CacheSize();
  std::set<double> found;
  for (const std::ptrdiff_t size : {32, 48, 64, 128}) {
    Eigen::setCpuCacheSizes(size << 10, second, third);
    found.insert(ratio(q));
  }
  Eigen::setCpuCacheSizes(first, second, third);
  EXPECT_EQ(found.size(), 1U);
}

TEST(HfRatio, WeighsByVelocityEnergy) {
  const auto energy = [](double a, double hz) { return std::pow(a * std::sin(kPi * hz / 50.0), 2); };
  const double low = energy(1.0, 2.0), high = energy(0.1, 10.0);
  EXPECT_NEAR(ratio(sine(2.0) + sine(10.0, 0.1)), high / (low + high), 1e-12);
}

TEST(HfRatio, VelocityReadings) {
  DiagnosticReadings readings;
  readings.velocity = VelocitySource::kGiven;
  const Eigen::MatrixXd q = sine(2.0, 1.0, 500);
  EXPECT_NEAR(hf_ratio(q, 50.0, readings, sine(10.0, 1.0, 500)), 1.0, 1e-12);
  EXPECT_NEAR(hf_ratio(q, 50.0, readings, sine(2.0, 1.0, 500)), 0.0, 1e-12);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)hf_ratio(q, 50.0, readings); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)hf_ratio(q, 50.0, readings, sine(2.0)); }));
  // Central differences damp 20 Hz more than plain ones do.
  const Eigen::MatrixXd mixed = sine(2.0) + sine(20.0, 0.05);
  readings.velocity = VelocitySource::kGradient;
  EXPECT_LT(ratio(mixed, readings), 0.5 * ratio(mixed));
}

TEST(HfRatio, MeanReadings) {
  Eigen::MatrixXd drift = sine(10.0, 0.01);
  for (int t = 0; t < drift.cols(); ++t) drift(0, t) += 0.1 * t;  // 5 rad/s throughout
  DiagnosticReadings removed;
  removed.mean = MeanHandling::kRemove;
  EXPECT_LT(ratio(drift), 0.1);
  EXPECT_NEAR(ratio(drift, removed), 1.0, 1e-9);
}

TEST(HfRatio, PoolReadings) {
  Eigen::MatrixXd q(3, 501);
  q << sine(2.0), sine(10.0, 0.1), Eigen::MatrixXd::Zero(1, 501);
  DiagnosticReadings joints;
  joints.pool = Pool::kMeanOfJoints;
  const double low = std::pow(std::sin(kPi * 2.0 / 50.0), 2), high = std::pow(0.1 * std::sin(kPi * 10.0 / 50.0), 2);
  EXPECT_NEAR(ratio(q), high / (low + high), 1e-12);
  EXPECT_NEAR(ratio(q, joints), 0.5, 1e-12);  // the still joint has no ratio
}

TEST(HfRatio, IsUndefinedWithoutMotion) {
  EXPECT_TRUE(std::isnan(ratio(Eigen::MatrixXd::Constant(2, 30, 0.7))));
  Eigen::MatrixXd ramp(1, 30);
  for (int t = 0; t < 30; ++t) ramp(0, t) = 0.013 * t;
  DiagnosticReadings removed;
  removed.mean = MeanHandling::kRemove;
  EXPECT_TRUE(std::isnan(ratio(ramp, removed)));  // rounding is not motion
  EXPECT_NEAR(ratio(ramp), 0.0, 1e-12);
}

TEST(HfRatio, IsAFractionThatIgnoresScaleAndTimesDirection) {
  Random random(3, 1);
  Eigen::MatrixXd q(4, 137);
  for (double& x : q.reshaped()) x = random.normal();
  for (const Spectrum spectrum : kSpectra) {
    DiagnosticReadings readings;
    readings.spectrum = spectrum;
    const double r = ratio(q, readings);
    EXPECT_GT(r, 0.0);
    EXPECT_LT(r, 1.0);
    EXPECT_NEAR(ratio(3.0 * q, readings), r, 1e-12);
    // The filter's passes do not commute at the ends.
    EXPECT_NEAR(ratio(q.rowwise().reverse(), readings), r, spectrum == Spectrum::kButterworth ? 1e-3 : 1e-9);
  }
}

BandEnergy band_energy(const Eigen::VectorXd& x, double rate_hz, double cutoff_hz, Spectrum spectrum, EdgeBin edge) {
  return band_energies(x.transpose(), rate_hz, cutoff_hz, spectrum, edge).at(0);
}

// The textbook transform, bin by bin.
double energy_above(const Eigen::VectorXd& x, double rate_hz, double cutoff_hz) {
  const int n = static_cast<int>(x.size());
  double sum = 0.0;
  for (int k = 0; k < n; ++k) {  // both halves of the spectrum
    std::complex<double> bin = 0.0;
    for (int t = 0; t < n; ++t) bin += x[t] * std::polar(1.0, -2.0 * kPi * k * t / n);
    if (std::min(k, n - k) * rate_hz > cutoff_hz * n) sum += std::norm(bin) / n;
  }
  return sum;
}

TEST(BandEnergy, PeriodogramIsTheDiscreteFourierTransform) {
  Random random(4, 1);
  for (const int n : {1, 2, 3, 7, 64, 503}) {
    Eigen::VectorXd x(n);
    for (double& v : x) v = random.normal();
    const BandEnergy e = band_energy(x, 50.0, 5.0, Spectrum::kPeriodogram, EdgeBin::kAbove);
    EXPECT_NEAR(e.total, x.squaredNorm(), 1e-12 * n) << n;
    EXPECT_NEAR(e.high, energy_above(x, 50.0, 5.0), 1e-10 * n) << n;
  }
}

TEST(BandEnergy, WelchOfAShortSignalIsHannOfTheWhole) {
  const Eigen::VectorXd x = sine(3.0, 1.0, 200).transpose();
  const BandEnergy welch = band_energy(x, 50.0, 5.0, Spectrum::kWelch, EdgeBin::kAbove);
  const BandEnergy hann = band_energy(x, 50.0, 5.0, Spectrum::kHann, EdgeBin::kAbove);
  EXPECT_EQ(welch.high, hann.high);
  EXPECT_EQ(welch.total, hann.total);
}

// Forwards and backwards, the filter halves the amplitude at its cut-off; a constant vanishes at once.
TEST(BandEnergy, ButterworthLeavesAQuarterOfThePowerAtTheCutOff) {
  const Eigen::VectorXd x = sine(5.0, 1.0, 5000).transpose();
  const BandEnergy e = band_energy(x, 50.0, 5.0, Spectrum::kButterworth, EdgeBin::kAbove);
  EXPECT_NEAR(e.high / e.total, 0.25, 0.002);
  const BandEnergy flat =
      band_energy(Eigen::VectorXd::Constant(40, 3.0), 50.0, 5.0, Spectrum::kButterworth, EdgeBin::kAbove);
  EXPECT_NEAR(flat.high, 0.0, 1e-20);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
      [&] { (void)band_energy(x, 10.0, 5.0, Spectrum::kButterworth, EdgeBin::kAbove); }));
}

Eigen::MatrixXd cubics() {  // jerks 3 and -4
  Eigen::MatrixXd q(2, 20);
  for (int t = 0; t < 20; ++t) q.col(t) = Eigen::Vector2d(0.5, -4.0 / 6.0) * std::pow(t / 50.0, 3);
  return q;
}

TEST(DofJerk, ReadingsOfCubics) {
  DiagnosticReadings readings;
  for (const JerkScheme scheme : {JerkScheme::kDiff, JerkScheme::kCentral}) {
    readings.jerk_scheme = scheme;
    readings.dof_jerk = JerkNorm::kMeanAbs;
    EXPECT_NEAR(dof_jerk(cubics(), 50.0, readings), 3.5, 1e-9);
    readings.dof_jerk = JerkNorm::kMeanNorm;
    EXPECT_NEAR(dof_jerk(cubics(), 50.0, readings), 5.0, 1e-9);
    readings.dof_jerk = JerkNorm::kRms;
    EXPECT_NEAR(dof_jerk(cubics(), 50.0, readings), std::sqrt(12.5), 1e-9);
  }
}

TEST(RootJerk, Readings) {
  Eigen::Matrix3Xd p = Eigen::Matrix3Xd::Zero(3, 5);  // third differences (3, 0, 4) and then zero
  p.col(3) = Eigen::Vector3d(3.0, 0.0, 4.0);
  p.col(4) = 3.0 * p.col(3);
  DiagnosticReadings readings;
  EXPECT_DOUBLE_EQ(root_jerk(p, 1.0, readings), 2.5);
  readings.root_jerk = JerkNorm::kRms;
  EXPECT_DOUBLE_EQ(root_jerk(p, 1.0, readings), std::sqrt(12.5));
  EXPECT_DOUBLE_EQ(root_jerk(p, 10.0), 2500.0);
}

TEST(RootError, OfAKnownShiftAndRotation) {
  std::vector<Pose> reference(2), found(2);
  found[0].p = Eigen::Vector3d(0.3, 0.4, 0.0);
  found[1].R = Eigen::AngleAxisd(kPi / 3, Eigen::Vector3d(1, -2, 0.5).normalized());
  EXPECT_NEAR(root_error(found, reference).position, 0.25, 1e-15);
  EXPECT_LE(root_error(found, reference).horizontal, root_error(found, reference).position);
  EXPECT_NEAR(root_error(found, reference).angle_deg, 30.0, 1e-12);
  found[1].R.coeffs() *= -1.0;  // the same rotation
  EXPECT_NEAR(root_error(found, reference).angle_deg, 30.0, 1e-12);
  found[1].R = Eigen::AngleAxisd(1e-8, Eigen::Vector3d::UnitY());
  EXPECT_NEAR(root_error(found, reference).angle_deg, 0.5e-8 * 180.0 / kPi, 1e-18);
}

TEST(RootError, RefusesBadInput) {
  const auto of = [](const auto& action) { return test::thrown_message<std::invalid_argument>(action); };
  const std::vector<Pose> two(2), three(3);
  EXPECT_SENTENCE(of([&] { (void)root_error(two, three); }));
  EXPECT_SENTENCE(of([&] { (void)root_error({}, {}); }));
  std::vector<Pose> bad(2);
  bad[1].p.x() = std::nan("");
  EXPECT_SENTENCE(of([&] { (void)root_error(two, bad); }));
  EXPECT_SENTENCE(of([&] { (void)root_error(bad, two); }));
  for (const Eigen::Quaterniond& R : {Eigen::Quaterniond(std::nan(""), 0, 0, 0), Eigen::Quaterniond(0, 0, 0, 0)}) {
    bad[1] = {.R = R, .p = Eigen::Vector3d::Zero()};
    EXPECT_SENTENCE(of([&] { (void)root_error(bad, two); }));
  }
}

TEST(DofErrors, Readings) {
  Eigen::MatrixXd q(2, 1), zero = Eigen::MatrixXd::Zero(2, 1);
  q << 3.0, -4.0;
  DiagnosticReadings readings;
  EXPECT_DOUBLE_EQ(dof_error(q, zero, zero, 2.0 * q, readings).position, 3.5);
  EXPECT_DOUBLE_EQ(dof_error(q, zero, zero, 2.0 * q, readings).velocity, 7.0);
  readings.dof_error = DofErrorNorm::kMeanNorm;
  EXPECT_DOUBLE_EQ(dof_error(q, zero, zero, 2.0 * q, readings).position, 5.0);
  readings.dof_error = DofErrorNorm::kRms;
  EXPECT_DOUBLE_EQ(dof_error(q, zero, zero, 2.0 * q, readings).position, std::sqrt(12.5));
  const auto of = [](const auto& action) { return test::thrown_message<std::invalid_argument>(action); };
  EXPECT_SENTENCE(of([&] { (void)dof_error(q, Eigen::MatrixXd::Zero(3, 1), q, q); }));
  EXPECT_SENTENCE(of([&] { (void)dof_error(q, q, q, Eigen::MatrixXd()); }));
}

Recording recording(int frames) {
  Recording r;
  for (int t = 0; t < frames; ++t) {
    RobotState state;
    state.q = Eigen::Vector2d(std::sin(0.1 * t), std::cos(0.3 * t));
    state.v = Eigen::Vector2d::Zero();
    state.X_WB.p = Eigen::Vector3d(0.01 * t, 0.0, 0.8);
    Reference reference{state.X_WB, state.q};
    reference.X_WB.p.y() += 0.05;
    reference.X_WB.R = yaw_rotation(0.2);
    reference.q[0] += 0.3;
    r.robot.push_back(state);
    r.reference.push_back(reference);
  }
  return r;
}

TEST(ControllerDiagnostics, ComparesExecutedAndReferenceFrameByFrame) {
  const Recording r = recording(40);
  const std::map<std::string, double> d = controller_diagnostics(r);
  EXPECT_EQ(d.size(), 10U);
  EXPECT_NEAR(d.at("root_error"), 0.05, 1e-15);
  EXPECT_NEAR(d.at("root_angle_error"), 0.2 * 180.0 / kPi, 1e-12);
  EXPECT_NEAR(d.at("dof_error"), 0.15, 1e-15);
  EXPECT_NEAR(d.at("dof_jerk"), d.at("dof_jerk_reference"), 1e-6);  // a constant offset has no jerk
  EXPECT_NEAR(d.at("root_jerk"), 0.0, 1e-6);
  EXPECT_NEAR(d.at("hf_ratio"), d.at("hf_ratio_reference"), 1e-12);
  double speed = 0.0;  // the recorded velocity is zero
  for (int j = 0; j < 2; ++j)
    for (int t = 0; t < 40; ++t) {
      const int a = std::max(t - 1, 0), b = std::min(t + 1, 39);
      speed += std::abs(r.reference[b].q[j] - r.reference[a].q[j]) * 50.0 / (b - a);
    }
  EXPECT_NEAR(d.at("dof_velocity_error"), speed / 80, 1e-12);
}

TEST(ControllerDiagnostics, PartsOfTheRootsErrorAreAlongTheFloorAndInHeight) {
  Recording r = recording(40);
  EXPECT_NEAR(root_error_parts(r).at("root_error.horizontal"), 0.05, 1e-15);
  EXPECT_NEAR(root_error_parts(r).at("root_error.vertical"), 0.0, 1e-15);
  for (Reference& reference : r.reference) reference.X_WB.p.z() -= 0.12;
  EXPECT_NEAR(root_error_parts(r).at("root_error.horizontal"), 0.05, 1e-15);
  EXPECT_NEAR(root_error_parts(r).at("root_error.vertical"), 0.12, 1e-15);
  EXPECT_NEAR(controller_diagnostics(r).at("root_error"), 0.13, 1e-15);  // 5, 12, 13
}

TEST(ControllerDiagnostics, RefusesBadRecordings) {
  const auto of = [](const Recording& r) {
    return test::thrown_message<std::invalid_argument>([&] { (void)controller_diagnostics(r); });
  };
  EXPECT_SENTENCE(of(recording(3)));
  Recording r = recording(10);
  r.reference.pop_back();
  EXPECT_SENTENCE(of(r));
  r = recording(10);
  r.robot[4].v.resize(1);
  EXPECT_SENTENCE(of(r));
  r = recording(10);
  r.robot[4].q[1] = std::nan("");
  EXPECT_SENTENCE(of(r));
  r = recording(10);
  r.rate_hz = -1.0;
  EXPECT_SENTENCE(of(r));
  EXPECT_NO_THROW((void)controller_diagnostics(recording(4)));
}

}  // namespace
}  // namespace duet
