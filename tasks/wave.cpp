// Wave: one raises a hand and waves, the other notices and answers.
//
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

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/evidence.h"
#include "duet/tasks/synthesis/act.h"
#include "duet/tasks/synthesis/varied.h"
#include "duet/tasks/task_definition.h"

namespace duet::synthesis {
namespace {

constexpr double kWaveRaise = 0.8;    // [s]
constexpr double kFastestHand = 2.4;  // at the middle of a stroke [m/s]

struct Waving {
  double amplitude;  // half of the stroke [m]
  double height;     // of the hand above the ground [m]
  Burst strokes;
  double ahead = 0.36, outward = 0.26;  // of the shoulder, in arms: the forearm waves, or the arm does
};

// The hand swings about the elbow: lowest at either end of the stroke, a little forward towards the middle of the body.
Hold waving_hand(const Waving& waving) {
  return [=](const Moment& m) {
    const double stroke = waving.amplitude * waving.strokes.at(m.t);
    const Eigen::Vector3d shoulder = m.own.p.col(sided(kLeftShoulder, m.side));
    const Eigen::Vector3d offset(waving.ahead * m.body.arm() - 0.2 * stroke, waving.outward * m.body.arm() + stroke,
                                 0.0);
    ArmPose arm;
    arm.hand = shoulder + chest_vector(m, offset) + 0.006 * m.sway;
    arm.hand.z() = waving.height + 0.006 * m.sway.z() - 1.6 * stroke * stroke;
    arm.pole = chest_vector(m, {-0.2, 0.5, -1.0});
    arm.wrist = -0.1;
    return arm;
  };
}

Layout wave_layout(const Participants& cast, Draws& draws) {
  Layout layout;
  layout.distance = std::min(draws.uniform("act.distance", 1.2, 2.2), cast.farthest);
  if (cast.manner.distance) layout.distance = *cast.manner.distance;
  stand_at_bearings(cast, layout);
  return layout;
}

void perform_wave(Scene& scene, Draws& draws) {
  const int side = scene.cast.side;
  const double length = scene.act_end - scene.act_begin;
  const double notice = draws.uniform("notice", 0.3, 0.8);
  const double stop = draws.uniform("a.stop", 0.72, 0.9);
  const std::array<double, 2> begin = {scene.act_begin, scene.act_begin + notice + scene.people[1].reaction};
  const std::array<double, 2> end = {scene.act_begin + stop * length, scene.act_end};
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const std::string who(kWho[k]);
    const double rate = draws.uniform(who + "wave.rate_hz", 1.7, 2.4);
    const double usual = draws.styled(who + "wave.amplitude", scene.cast.style, 0.12, 0.20);
    const double high = draws.styled(who + "wave.share", scene.cast.style, 0.87, 1.02);
    Waving waving;
    waving.amplitude = std::min(usual, kFastestHand / (2.0 * std::numbers::pi * rate));
    waving.height = scene.cast.target_height.value_or(high * person.body.height);
    waving.strokes = {begin[k] + 0.75 * kWaveRaise, end[k], rate, 0.35};
    if (draws.breadth() > 0.0) {
      waving.ahead = draws.uniform(who + "wave.ahead", 0.15, 0.6);
      waving.outward = draws.uniform(who + "wave.outward", 0.1, 0.5);
    }
    draws.record(who + "target_height", waving.height);
    person.arms[side].to(begin[k], begin[k] + kWaveRaise, waving_hand(waving), {0.08, 0.06, 0.0});
    person.arms[side].rest(end[k], end[k] + scene.release_end - scene.act_end, {0.08, 0.05, 0.0});
  }
}

}  // namespace
}  // namespace duet::synthesis

namespace duet {
namespace {

Tracks wave_tracks(const Agent& performer, const Agent& partner, const DetectorReadings& readings) {
  Tracks tracks = hands_of("performer", performer);
  tracks.push_back({"performer.root", &performer.root});
  if (readings.wave_plane == WavePlane::kLateralUp) append(tracks, direction_to(performer, partner));
  return tracks;
}

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

// Algorithm 4. Parts motion_sufficient, direction_changes, amplitude_check, height_check. Evidence: frames at which a
// counted change of direction happens.
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

constexpr auto kWaveThresholds = std::to_array<ThresholdInfo>({
    {"motion_dist", 0.5, 0.5, "m", "path of the hand that moves more is longer"},
    {"min_changes", 3, 3, "1", "changes of its direction, at least"},
    {"amplitude", 0.3, 0.3, "m", "its peak to peak, at least"},
    {"angle", 0.785, 0.785, "rad", "a change of direction turns by more"},
    {"height", 0.45, 0.45, "m", "the higher hand is at least so high above the root, at its highest"},
    {"displacement", 0.005, 0.005, "m", "a change of direction counts where the step after it is longer"},
});

constexpr auto kWaveFigures = std::to_array<DetectorFigure>({
    {"motion_total", "m", "path of the hand that moves more"},
    {"direction_changes", "1", "counted changes of its direction"},
    {"amplitude", "m", "its peak to peak"},
    {"height", "m", "height of the judged hand above the root"},
});

constexpr auto kWavePhrases = std::to_array<TaskPhrase>({
    {"wave", 1.0},
    {"wave hand", 1.0},
    {"wave hello", 1.0},
    {"hello afar", 1.0},
    {"greet afar", 1.0},
    {"greet distance", 1.0},
    {"hello", 0.5},
    {"hi", 0.5},
    {"goodbye", 0.8},
    {"bye", 0.8},
    {"farewell", 0.8},
    {"afar", 0.4},
});

constexpr auto kWaveParaphrases = std::to_array<std::string_view>({
    "wave at the person",
    "wave hello",
    "wave your hand",
    "say hello from afar",
    "wave goodbye to them",
    "greet the person from a distance",
    "say hi with a wave",
    "waving to the human",
    "raise your arm and wave",
    "bid them farewell",
    "wave back",
    "say bye to her",
});

}  // namespace

namespace tasks {

const TaskDefinition& wave() {
  static constexpr TaskDefinition kDefinition = {.name = "wave",
                                                 .prompt = "wave to the person",
                                                 .paraphrases = kWaveParaphrases,
                                                 .phrases = kWavePhrases,
                                                 .phases = {.act = ActSignal::kHandsUp},
                                                 .act = {.mean_seconds = 18.6,
                                                         .shortest = 4.5,
                                                         .longest = 9.0,
                                                         .release = 1.0,
                                                         .lowest = 1.45,
                                                         .highest = 1.7,
                                                         .touch_distance = 0.0,
                                                         .close = false,
                                                         .layout = synthesis::wave_layout,
                                                         .perform = synthesis::perform_wave,
                                                         .recorded = {.tempo = {1.0, 1.2, 1.5}, .way = {0.0, 0.1, 0.4}},
                                                         .varied = synthesis::varied_gesture(0.12)},
                                                 .detector = {.thresholds = kWaveThresholds,
                                                              .figures = kWaveFigures,
                                                              .tracks = wave_tracks,
                                                              .detect = detect_wave},
                                                 .rule = &rules::kWave,
                                                 .interaction = {.onset = ActOnset::kHandRises}};
  return kDefinition;
}

}  // namespace tasks
}  // namespace duet
