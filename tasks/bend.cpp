// Bend: both bow to each other from the hips, hold it, come up again.
//
// The angle of the head over the root from the vertical. With reading `forward` only frames count at which the head
// leans towards the partner (or to the performer's front, from the line of shoulders).
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/evidence.h"
#include "duet/tasks/synthesis/act.h"
#include "duet/tasks/synthesis/varied.h"
#include "duet/tasks/task_definition.h"

namespace duet::synthesis {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kHeadRoom = 0.38;  // between the two heads at the lowest [m]

Eigen::Vector3d head_from_root(const Body& body, const Lean& lean) {
  PosedBody figure;
  pose_torso(body, standing_torso(body, {}, lean, body.stand_height), figure);
  return figure.p.col(kHead) - figure.p.col(kPelvis);
}

// The lean at which the line from pelvis to head is inclined by `inclination`.
Lean bow_of(const Body& body, double inclination) {
  double low = 0.0, high = 0.75 * std::numbers::pi;
  Lean lean;
  for (int i = 0; i < 50; ++i) {
    lean.forward = 0.5 * (low + high);
    const Eigen::Vector3d v = head_from_root(body, lean);
    (std::atan2(v.x(), v.z()) < inclination ? low : high) = lean.forward;
  }
  return lean;
}

struct Bow {
  double begin, down, up, end;  // starts, is down, comes up, is up [s]
};

std::vector<Bow> plan_bows(double begin, double end, double down, double up, double hold) {
  constexpr double kBetween = 0.7, kLongestHold = 3.2;
  const double one = down + hold + up;
  const int count = end - begin >= 2.0 * one + kBetween && end - begin - one > kLongestHold ? 2 : 1;
  const double length = (end - begin - (count - 1) * kBetween) / count;
  std::vector<Bow> bows;
  for (int i = 0; i < count; ++i) {
    const double first = begin + i * (length + kBetween);
    bows.push_back({first, first + down, first + length - up, first + length});
  }
  return bows;
}

Layout bend_layout(const Participants& cast, Draws& draws) {
  const double depth = draws.styled("inclination", cast.style, 33.0 * kDegree, 57.0 * kDegree);
  const double differs = draws.uniform("b.deeper", -4.0 * kDegree, 4.0 * kDegree);
  Layout layout;
  layout.distance = kHeadRoom;
  for (const int k : {0, 1}) {
    const double own = std::clamp(depth + (k == 1 ? differs : 0.0), 32.0 * kDegree, 58.0 * kDegree);
    draws.record(k == 0 ? "a.inclination" : "b.inclination", own);
    layout.lean[k] = bow_of(cast.body[k], own);
    layout.distance += head_from_root(cast.body[k], layout.lean[k]).x();
  }
  layout.distance = std::min(layout.distance + draws.uniform("act.room", 0.0, 0.5), cast.farthest);
  if (cast.manner.distance) layout.distance = std::max(layout.distance, *cast.manner.distance);
  stand_at_bearings(cast, layout);
  return layout;
}

void perform_bend(Scene& scene, Draws& draws) {
  const double down = draws.styled("down", 1.0 - scene.cast.style, 1.0, 1.5);
  const double up = draws.uniform("up", 1.1, 1.5);
  const double hold = draws.uniform("hold", 0.7, 1.4);
  const double later = draws.uniform("b.later", 0.0, 0.3) + scene.people[1].reaction;
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const double begin = scene.act_begin + k * later;
    const double end = scene.act_end - (1 - k) * later;
    for (const Bow& bow : plan_bows(begin, end, down, up, hold)) {
      person.lean_to(bow.begin, bow.down, scene.layout.lean[k]);
      person.lean_to(bow.up, bow.end, {});
      person.look.to(bow.begin, bow.down, 0.0);
      person.look.to(bow.up, bow.end, 1.0);
      person.nod.to(bow.begin, bow.down, 0.15);
      person.nod.to(bow.up, bow.end, 0.0);
    }
  }
}

}  // namespace
}  // namespace duet::synthesis

namespace duet {
namespace {

Tracks bend_tracks(const Agent& performer, const Agent& partner, const DetectorReadings& readings) {
  Tracks tracks = {{"performer.head", &performer.head}, {"performer.root", &performer.root}};
  if (readings.bend_direction == BendDirection::kForward) append(tracks, direction_to(performer, partner));
  return tracks;
}

// atan2 instead of an arc cosine: exact for small angles; 0 where head and root coincide.
Eigen::ArrayXd bend_angles(const Agent& performer) {
  Eigen::ArrayXd angles(performer.head.cols());
  for (Eigen::Index t = 0; t < angles.size(); ++t) {
    const Eigen::Vector3d v = performer.head.col(t) - performer.root.col(t);
    angles[t] = std::atan2(v.head<2>().norm(), v.z());
  }
  return angles;
}

FrameMask leaning_forward(const Agent& performer, const Agent& partner) {
  FrameMask forward(performer.head.cols());
  for (Eigen::Index t = 0; t < performer.head.cols(); ++t) {
    const Eigen::Vector3d lean = performer.head.col(t) - performer.root.col(t);
    Eigen::Vector3d front;
    if (partner.root.cols() > 0) {
      front = partner.root.col(t) - performer.root.col(t);
    } else {
      const Eigen::Vector3d to_left = performer.lshoulder.col(t) - performer.rshoulder.col(t);
      front = to_left.cross(Eigen::Vector3d::UnitZ());
    }
    forward[t] = lean.head<2>().dot(front.head<2>()) > 0.0;
  }
  return forward;
}

// Algorithm 5. Parts angle_condition, stability_condition. Evidence: frames bent far enough.
DetectorResult detect_bend(const Agent& performer, const Agent& partner, const Thresholds& tau,
                           const DetectorReadings& readings) {
  const Eigen::ArrayXd angle = bend_angles(performer);
  const FrameMask counted = readings.bend_direction == BendDirection::kForward ? leaning_forward(performer, partner)
                                                                               : FrameMask(angle.size(), true);
  const bool consecutive = readings.bend_frames == BendFrames::kConsecutive;

  DetectorResult result;
  result.frames = both(at_least(angle, tau.at("min_angle")), counted);
  const int frames = consecutive ? longest_run(result.frames) : count_frames(result.frames);
  result.parts["angle_condition"] = count_frames(result.frames) > 0;
  result.parts["stability_condition"] = frames >= tau.at("min_frames");
  result.success = result.parts["angle_condition"] && result.parts["stability_condition"];

  double max_angle = 0.0;
  for (Eigen::Index t = 0; t < angle.size(); ++t)
    if (counted[t]) max_angle = std::max(max_angle, angle[t]);
  result.values = {{"max_angle", max_angle}, {"frames_above", frames}};

  const int k = frames_needed(tau.at("min_frames"));
  result.margins = {{"min_angle", consecutive ? run_slack_above(tau.at("min_angle"), angle, k, counted)
                                              : count_slack_above(tau.at("min_angle"), angle, k, counted)},
                    {"min_frames", frames - tau.at("min_frames")}};
  return result;
}

void read_bend_strictly(DetectorReadings& readings) { readings.bend_direction = BendDirection::kForward; }

constexpr auto kBendThresholds = std::to_array<ThresholdInfo>({
    {"min_angle", 0.349, std::numbers::pi / 6, "rad", "the trunk is inclined by at least"},
    {"min_frames", 5, 5, "frames", "frames of such inclination, at least"},
});

constexpr auto kBendFigures = std::to_array<DetectorFigure>({
    {"max_angle", "rad", "largest inclination of the trunk"},
    {"frames_above", "frames", "frames of enough inclination"},
});

constexpr auto kBendPhrases = std::to_array<TaskPhrase>({
    {"bend", 1.0},
    {"bent", 1.0},
    {"bow", 1.0},
    {"curtsy", 1.0},
    {"lean forward", 1.0},
    {"lean down", 1.0},
    {"stoop", 1.0},
    {"lower head", 0.8},
    {"lower upper body", 1.0},
    {"incline", 0.8},
});

constexpr auto kBendParaphrases = std::to_array<std::string_view>({
    "bow to the person",
    "bend down",
    "bend forward towards the person",
    "make a curtsy",
    "take a bow",
    "greet with a bow",
    "lean forward politely",
    "bowing to your partner",
    "bow your head and upper body",
    "bend at the waist",
    "show respect by bowing",
    "incline your body to them",
});

}  // namespace

namespace tasks {

const TaskDefinition& bend() {
  static constexpr TaskDefinition kDefinition = {
      .name = "bend",
      .prompt = "bend down to the person",
      .paraphrases = kBendParaphrases,
      .phrases = kBendPhrases,
      .phases = {.act = ActSignal::kTrunksLean},
      .act = {.mean_seconds = 17.6,
              .shortest = 4.5,
              .longest = 9.5,
              .release = 0.6,
              .lowest = 0.0,
              .highest = 0.0,
              .touch_distance = 0.0,
              .close = false,
              .layout = synthesis::bend_layout,
              .perform = synthesis::perform_bend,
              .recorded = {.tempo = {1.0, 1.25, 1.6}, .way = {0.0, 0.1, 0.4}},
              .varied = synthesis::varied_gesture(0.0)},
      .detector = {.thresholds = kBendThresholds,
                   .figures = kBendFigures,
                   .tracks = bend_tracks,
                   .detect = detect_bend,
                   .read_strictly = read_bend_strictly},
      .rule = &rules::kBend,
      .interaction = {.onset = ActOnset::kTrunkLeans}};
  return kDefinition;
}

}  // namespace tasks
}  // namespace duet
