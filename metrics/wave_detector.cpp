// Printed: the hand that moves farther waves; directions of motion are angles of components 0 and 1, the floor plane
// when z is up. Not printed and decided here: a change of direction at sample i counts where the step that follows it,
// p[i + 1] - p[i], is longer than `displacement` (CheckDisplacement); peak to peak is the largest of the three axes;
// the height is that of the higher hand at its highest. In frame `root` the performer's root is taken off the hand
// (translation only).
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "metrics/frame_windows.h"
#include "metrics/task_detectors.h"

namespace duet {
namespace {

using Axes = Eigen::Matrix<double, 2, 3>;  // the two directions of the plane in which motion is seen

double path_length(const Eigen::Matrix3Xd& track) {
  return (track.rightCols(track.cols() - 1) - track.leftCols(track.cols() - 1)).colwise().norm().sum();
}

// Horizontal direction across the performer, mean over the clip: at right angles to the line to the partner's root, or
// along the shoulders.
Eigen::Vector3d lateral(const Agent& performer, const Agent& partner) {
  Eigen::Vector3d across;
  if (partner.root.cols() > 0) {
    const Eigen::Vector3d to_partner = partner.root.rowwise().mean() - performer.root.rowwise().mean();
    across = Eigen::Vector3d::UnitZ().cross(to_partner);
  } else {
    across = performer.lshoulder.rowwise().mean() - performer.rshoulder.rowwise().mean();
    across.z() = 0.0;
  }
  return across.norm() > 0.0 ? Eigen::Vector3d(across.normalized()) : Eigen::Vector3d::Zero();
}

Axes principal_axes(const Eigen::Matrix3Xd& track) {
  const Eigen::Matrix3Xd centred = track.colwise() - track.rowwise().mean();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(centred * centred.transpose());
  Axes axes;
  axes << solver.eigenvectors().col(2).transpose(), solver.eigenvectors().col(1).transpose();
  return axes;
}

// Nothing where the plane is undefined: the performer and the partner stand in one place.
std::optional<Axes> plane(const Eigen::Matrix3Xd& track, const Agent& performer, const Agent& partner,
                          WavePlane reading) {
  if (reading == WavePlane::kPca) return principal_axes(track);
  Axes axes = Axes::Identity();
  if (reading == WavePlane::kLateralUp) {
    const Eigen::Vector3d across = lateral(performer, partner);
    if (across.isZero(0.0)) return std::nullopt;
    axes << across.transpose(), Eigen::RowVector3d::UnitZ();
  }
  return axes;
}

// Angle of every step in the plane, T - 1 entries in (-pi, pi]; 0 for a step of length zero. Adding 0.0 clears a
// negative zero, which would turn the angle by pi.
Eigen::ArrayXd step_angles(const Eigen::Matrix3Xd& track, const Axes& axes) {
  Eigen::ArrayXd angles(track.cols() - 1);
  for (Eigen::Index i = 0; i < angles.size(); ++i) {
    const Eigen::Vector2d step = axes * (track.col(i + 1) - track.col(i));
    angles[i] = std::atan2(step.y() + 0.0, step.x() + 0.0);
  }
  return angles;
}

// Per frame: the turn between the steps before and after it [rad], the displacement that CheckDisplacement looks at
// [m], and whether a change is counted there. The first and the last frame have no turn.
struct Turns {
  Eigen::ArrayXd angle, displacement;
  FrameMask candidate, counted;
};

double displacement_at(const Eigen::Matrix3Xd& track, Eigen::Index i, Eigen::Index last, WaveDisplacement reading) {
  const double after = (track.col(i + 1) - track.col(i)).norm();
  if (reading == WaveDisplacement::kBothSteps) return std::min(after, (track.col(i) - track.col(i - 1)).norm());
  if (reading == WaveDisplacement::kSinceLast) return (track.col(i) - track.col(last)).norm();
  return after;
}

Turns find_turns(const Eigen::Matrix3Xd& track, const std::optional<Axes>& axes, const Thresholds& tau,
                 WaveDisplacement reading) {
  const Eigen::Index frames = track.cols();
  Turns turns{Eigen::ArrayXd::Zero(frames), Eigen::ArrayXd::Zero(frames), FrameMask(frames), FrameMask(frames)};
  if (!axes) return turns;
  const Eigen::ArrayXd theta = step_angles(track, *axes);
  Eigen::Index last = 0;  // where the last change was counted; the first frame before that
  for (Eigen::Index i = 1; i + 1 < frames; ++i) {
    double turn = std::abs(theta[i] - theta[i - 1]);
    if (turn > std::numbers::pi) turn = 2.0 * std::numbers::pi - turn;
    turns.angle[i] = turn;
    turns.displacement[i] = displacement_at(track, i, last, reading);
    turns.candidate[i] = true;
    const bool far = reading == WaveDisplacement::kNone || turns.displacement[i] > tau.at("displacement");
    turns.counted[i] = turn > tau.at("angle") && far;
    if (turns.counted[i]) last = i;
  }
  return turns;
}

double diameter(const Eigen::Matrix3Xd& track) {
  double largest = 0.0;
  for (Eigen::Index t = 1; t < track.cols(); ++t)
    largest = std::max(largest, (track.leftCols(t).colwise() - track.col(t)).colwise().squaredNorm().maxCoeff());
  return std::sqrt(largest);
}

double amplitude(const Eigen::Matrix3Xd& track, WaveAmplitude reading) {
  const Eigen::Vector3d extent = track.rowwise().maxCoeff() - track.rowwise().minCoeff();
  switch (reading) {
    case WaveAmplitude::kDiagonal:
      return extent.norm();
    case WaveAmplitude::kDiameter:
      return diameter(track);
    case WaveAmplitude::kHorizontal:
      return extent.head<2>().norm();
    case WaveAmplitude::kMaxAxis:
      break;
  }
  return extent.maxCoeff();
}

double median(Eigen::ArrayXd values) {
  const Eigen::Index n = values.size();
  std::sort(values.begin(), values.end());
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

double judged_height(const Agent& performer, const Eigen::Matrix3Xd& active, WaveHeight reading) {
  const Eigen::ArrayXd height = heights(active, performer.root);
  switch (reading) {
    case WaveHeight::kActiveMax:
      return height.maxCoeff();
    case WaveHeight::kActiveMean:
      return height.mean();
    case WaveHeight::kActiveMedian:
      return median(height);
    case WaveHeight::kAnyHandMax:
      break;
  }
  return std::max(heights(performer.lhand, performer.root).maxCoeff(),
                  heights(performer.rhand, performer.root).maxCoeff());
}

// Margins of angle and displacement: by how much each could grow while min_changes changes still pass the other. For
// `since_last` the displacements are those measured on the way, so the margin is that of one change more or less.
void add_turn_margins(const Turns& turns, const Thresholds& tau, WaveDisplacement reading, DetectorResult& result) {
  const int k = frames_needed(tau.at("min_changes"));
  const bool checked = reading != WaveDisplacement::kNone;
  const FrameMask far = checked ? above(turns.displacement, tau.at("displacement")) : turns.candidate;
  result.margins["angle"] = count_slack_above(tau.at("angle"), turns.angle, k, both(turns.candidate, far));
  if (checked)
    result.margins["displacement"] =
        count_slack_above(tau.at("displacement"), turns.displacement, k, above(turns.angle, tau.at("angle")));
}

}  // namespace

DetectorResult detect_wave(const Agent& performer, const Agent& partner, const Thresholds& tau,
                           const DetectorReadings& readings) {
  const bool from_root = readings.wave_frame == MotionFrame::kRoot;
  const Eigen::Matrix3Xd left = from_root ? Eigen::Matrix3Xd(performer.lhand - performer.root) : performer.lhand;
  const Eigen::Matrix3Xd right = from_root ? Eigen::Matrix3Xd(performer.rhand - performer.root) : performer.rhand;
  const double left_length = path_length(left);
  const double right_length = path_length(right);
  const bool left_active = left_length > right_length;
  const Eigen::Matrix3Xd& track = left_active ? left : right;

  const double total = std::max(left_length, right_length);
  const Turns turns =
      find_turns(track, plane(track, performer, partner, readings.wave_plane), tau, readings.wave_displacement);
  const int changes = count_frames(turns.counted);
  const double extent = amplitude(track, readings.wave_amplitude);
  const double height = judged_height(performer, left_active ? performer.lhand : performer.rhand, readings.wave_height);

  DetectorResult result;
  result.frames = turns.counted;
  result.parts["motion_sufficient"] = total > tau.at("motion_dist");
  result.parts["direction_changes"] = changes >= tau.at("min_changes");
  result.parts["amplitude_check"] = extent >= tau.at("amplitude");
  result.parts["height_check"] = height >= tau.at("height");
  result.success = std::all_of(result.parts.begin(), result.parts.end(), [](const auto& part) { return part.second; });
  result.values = {{"motion_total", total}, {"direction_changes", changes}, {"amplitude", extent}, {"height", height}};
  result.margins = {{"motion_dist", total - tau.at("motion_dist")},
                    {"min_changes", changes - tau.at("min_changes")},
                    {"amplitude", extent - tau.at("amplitude")},
                    {"height", height - tau.at("height")}};
  add_turn_margins(turns, tau, readings.wave_displacement, result);
  return result;
}

}  // namespace duet
