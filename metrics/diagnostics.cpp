#include "duet/metrics/diagnostics.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "duet/core/require.h"
#include "duet/metrics/differences.h"
#include "duet/metrics/spectrum.h"
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

}  // namespace duet
