// Hug: arms open on the last steps, one over and one under the partner's arms (the taller one's over where statures
// differ much), hands on the back, perhaps a pat, then apart.
//
// Only the double embrace is printed. The single embrace takes one hand within `body` of the torso, the shoulder
// embrace both hands within `shoulder` of the nearer shoulder; the readings offer the alternatives.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/evidence.h"
#include "duet/tasks/synthesis/act.h"
#include "duet/tasks/synthesis/varied.h"
#include "duet/tasks/task_definition.h"

namespace duet::synthesis {
namespace {

constexpr double kOpen = 0.9;         // arms open this long before the act [s]
constexpr double kWrap = 1.15;        // [s]
constexpr double kSkin = 0.025;       // hand joint above the surface of the torso [m]
constexpr double kStatureGap = 0.13;  // from here on the taller one's arms both go over [m]
constexpr std::array<SmplJoint, 3> kBackJoints = {kSpine1, kSpine2, kSpine3};

// Found on the 21 hugs of SBU (docs/synthesis.md).
constexpr RecordedManner kRecordedHug = {.tempo = {1.1, 1.36, 1.7},
                                         .touch = {0.05, 0.05, 0.5},
                                         .until_touch = kWrap,
                                         .distance = {0.2, 0.24, 0.42},
                                         .bearing = {-0.45, 0.17, 0.8},
                                         .way = {0.5, 0.8, 1.05},
                                         .speed = {1.6, 2.0, 2.4},
                                         .stands = 0.03,
                                         .overlap = {0.15, 0.26, 0.4},
                                         .reaction = {0.1, 0.38, 0.5},
                                         .left = 0.1,
                                         .before = {0.62, 0.92, 1.6},
                                         .after = {0.3, 0.56, 1.0}};

// Where a hand lies on the partner's back, relative to a joint of the partner's spine (that joint's axes).
struct Spot {
  SmplJoint joint = kSpine3;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  bool over = false;
};

bool goes_over(const Participants& cast, int person, int arm) {
  const double taller = cast.body[person].height - cast.body[1 - person].height;
  if (std::abs(taller) > kStatureGap) return taller > 0.0;
  return arm == cast.side;
}

PosedBody embracing(const Participants& cast, const Layout& layout, int person) {
  PosedBody figure;
  const Body& body = cast.body[person];
  pose_torso(body, standing_torso(body, {}, layout.lean[person], body.stand_height), figure);
  return figure;
}

Spot spot_for(const Participants& cast, const Layout& layout, int person, int arm, Draws& draws) {
  const PosedBody own = embracing(cast, layout, person), partner = embracing(cast, layout, 1 - person);
  Spot spot;
  spot.over = goes_over(cast, person, arm);
  const std::string name = fmt::format("{}{}.spot", kWho[person], arm == 0 ? "left" : "right");
  double below = draws.uniform(name + ".below", spot.over ? 0.10 : 0.12, spot.over ? 0.16 : 0.2);
  if (!cast.manner.rehearsed) below += draws.uniform(name + ".lower", 0.05, 0.3);  // height of the hands in SBU's hugs
  const double wanted = cast.target_height ? *cast.target_height + (spot.over ? 0.03 : -0.03)
                                           : own.p(2, sided(kLeftShoulder, arm)) - below;
  const double z =
      std::clamp(wanted, partner.p(2, kSpine1) - (cast.manner.rehearsed ? 0.03 : 0.08), partner.p(2, kSpine3) + 0.09);
  for (const SmplJoint joint : kBackJoints)
    if (std::abs(z - partner.p(2, joint)) < std::abs(z - partner.p(2, spot.joint))) spot.joint = joint;
  // My left arm comes round the partner's right side.
  const double entry = -side_sign(arm);
  spot.offset = {-(cast.body[1 - person].torso_radius + kSkin), entry * draws.uniform(name + ".aside", 0.01, 0.06),
                 z - partner.p(2, spot.joint)};
  return spot;
}

Hold on_back(const Spot& spot, const std::vector<Burst>& pats, double lift) {
  return [=](const Moment& m) {
    double pat = 0.0;
    for (const Burst& burst : pats) pat += std::pow(burst.at(m.t), 2);
    const Eigen::Vector3d offset = spot.offset - Eigen::Vector3d(lift * pat, 0.0, 0.0);
    ArmPose arm;
    arm.hand = m.partner.p.col(spot.joint) + m.partner.R[spot.joint] * offset;
    arm.pole = chest_vector(m, spot.over ? Eigen::Vector3d(0.1, 1.0, 0.35) : Eigen::Vector3d(-0.1, 1.0, -0.55));
    arm.wrist = 0.35;
    return arm;
  };
}

Hold open_arm(bool over, double width) {
  return from_shoulder({0.62, width, over ? 0.02 : -0.34}, {-0.3, 0.8, over ? -0.3 : -0.8}, 0.15);
}

std::vector<Burst> plan_pats(const std::string& who, double begin, double end, Draws& draws) {
  if (!draws.chance(who + "pats", 0.4)) return {};
  const double start = draws.stream(who + "pats.start").uniform(begin, std::max(begin, end - 2.0));
  return {{start, std::min(start + 1.8, end), 0.9, 0.4}};
}

constexpr double kMostHugLean = 0.45;  // of a trunk [rad]

// They stand at `distance` (not so near that their trunks would be in each other) and lean into the embrace.
void stand_off(const Participants& cast, double distance, Layout& layout) {
  if (distance <= layout.distance) return;
  const auto between = [&] {
    double gap = distance;
    for (const int k : {0, 1}) gap -= cast.body[k].torso_radius + embracing(cast, layout, k).p(0, kSpine3);
    return gap;
  };
  while (between() > 0.03 && layout.lean[0].forward < kMostHugLean)
    for (Lean& lean : layout.lean) lean.forward += 0.01;
  layout.distance = distance;
}

Layout hug_layout(const Participants& cast, Draws& draws) {
  Layout layout;
  const double lean = draws.styled("lean", cast.style, 0.08, 0.17);
  const double gap = draws.uniform("gap", 0.01, 0.05);
  const double aside = draws.uniform("aside", 0.045, 0.07);
  // Each stands a little to the side of the arm that goes over, so that the heads pass each other.
  layout.lateral = -side_sign(cast.side) * 2.0 * aside;
  layout.distance = gap;
  for (const int k : {0, 1}) {
    layout.lean[k].forward = lean;
    layout.lean[k].side = -side_sign(cast.side) * 0.05;
    if (!cast.manner.rehearsed) layout.lean[k].shift = draws.uniform(k == 0 ? "a.shift" : "b.shift", 0.07, 0.14);
    layout.distance += cast.body[k].torso_radius + embracing(cast, layout, k).p(0, kSpine3);
  }
  if (cast.manner.distance)
    stand_off(cast, *cast.manner.distance + layout.lean[0].shift + layout.lean[1].shift, layout);
  stand_at_bearings(cast, layout);
  return layout;
}

void perform_hug(Scene& scene, Draws& draws) {
  const double width = draws.styled("open.width", scene.cast.style, 0.10, 0.32);
  const double lift = draws.uniform("pat.lift", 0.015, 0.03);
  const double closed = scene.act_begin + kWrap + scene.people[1].reaction;
  const double free = scene.act_end + 0.55;
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const std::string who(kWho[k]);
    const double wrap = scene.act_begin + person.reaction;
    person.lean_to(wrap, wrap + kWrap, scene.layout.lean[k]);
    person.lean_to(scene.act_end + 0.2, scene.release_end - 0.1, {});
    const std::vector<Burst> pats = plan_pats(who, closed + 0.3, scene.act_end - 0.1, draws);
    for (const int arm : {0, 1}) {
      const Spot spot = spot_for(scene.cast, scene.layout, k, arm, draws);
      const bool pats_here = arm == scene.cast.side;
      const Eigen::Vector3d round(0.06, spot.over ? 0.14 : 0.17, spot.over ? 0.10 : -0.02);
      ArmTrack& track = person.arms[arm];
      const Hold open = open_arm(spot.over, width);
      track.to(wrap - kOpen, wrap, open, {0.02, 0.05, 0.0});
      track.to(wrap, wrap + kWrap, on_back(spot, pats_here ? pats : std::vector<Burst>{}, lift), round);
      track.to(scene.act_end, free, open, round);
      track.rest(free, scene.release_end, {0.0, 0.05, 0.0});
      const int hand = sided(kLeftHand, arm);
      scene.touches.push_back({closed, scene.act_end, k == 0 ? hand : spot.joint, k == 0 ? spot.joint : hand});
    }
  }
}

}  // namespace
}  // namespace duet::synthesis

namespace duet {
namespace {

Tracks hug_tracks(const Agent& performer, const Agent& partner, const DetectorReadings& readings) {
  Tracks tracks = hands_of("performer", performer);
  tracks.push_back({"partner.torso", &partner.torso});
  if (readings.hug_shoulder == HugShoulder::kBothHands || readings.hug_shoulder == HugShoulder::kAnyHand) {
    tracks.push_back({"partner.lshoulder", &partner.lshoulder});
    tracks.push_back({"partner.rshoulder", &partner.rshoulder});
  }
  return tracks;
}

// A way to embrace: frames at which it holds and by how much, per track of evidence. Several only where each hand
// counts for itself.
struct Mode {
  std::vector<FrameMask> holds;
  std::vector<Eigen::ArrayXd> slack;
};

struct HandDistances {
  Eigen::ArrayXd hands, left_torso, right_torso;
  Eigen::ArrayXd left_shoulder, right_shoulder;  // of each hand to the nearer shoulder; empty where not needed
};

HandDistances hand_distances(const Agent& performer, const Agent& partner, HugShoulder shoulder) {
  HandDistances d;
  d.hands = distances(performer.lhand, performer.rhand);
  d.left_torso = distances(performer.lhand, partner.torso);
  d.right_torso = distances(performer.rhand, partner.torso);
  if (shoulder == HugShoulder::kBothHands || shoulder == HugShoulder::kAnyHand) {
    d.left_shoulder = distances(performer.lhand, partner.lshoulder).min(distances(performer.lhand, partner.rshoulder));
    d.right_shoulder = distances(performer.rhand, partner.lshoulder).min(distances(performer.rhand, partner.rshoulder));
  }
  return d;
}

Mode closer_than(double threshold, const Eigen::ArrayXd& distance) {
  return {{below(distance, threshold)}, {threshold - distance}};
}

Mode double_mode(const HandDistances& d, double hand_dist, double body) {
  const Eigen::ArrayXd farther = d.left_torso.max(d.right_torso);
  return {{both(below(d.hands, hand_dist), below(farther, body))}, {(hand_dist - d.hands).min(body - farther)}};
}

Mode single_mode(const HandDistances& d, double body, HugSingle reading) {
  const Eigen::ArrayXd nearer = d.left_torso.min(d.right_torso);
  const Eigen::ArrayXd farther = d.left_torso.max(d.right_torso);
  switch (reading) {
    case HugSingle::kAnyHand:
      return closer_than(body, nearer);
    case HugSingle::kSameHand:
      return {{below(d.left_torso, body), below(d.right_torso, body)}, {body - d.left_torso, body - d.right_torso}};
    case HugSingle::kExactlyOne:
      return {{both(below(nearer, body), at_least(farther, body))}, {(body - nearer).min(farther - body)}};
    case HugSingle::kOff:
      break;
  }
  return {};
}

Mode shoulder_mode(const HandDistances& d, double shoulder, HugShoulder reading) {
  switch (reading) {
    case HugShoulder::kBothHands:
      return closer_than(shoulder, d.left_shoulder.max(d.right_shoulder));
    case HugShoulder::kAnyHand:
      return closer_than(shoulder, d.left_shoulder.min(d.right_shoulder));
    case HugShoulder::kTorsoBoth:
      return closer_than(shoulder, d.left_torso.max(d.right_torso));
    case HugShoulder::kTorsoAny:
      return closer_than(shoulder, d.left_torso.min(d.right_torso));
    case HugShoulder::kOff:
      break;
  }
  return {};
}

int run_of(const Mode& mode) {
  int longest = 0;
  for (const FrameMask& holds : mode.holds) longest = std::max(longest, longest_run(holds));
  return longest;
}

double margin_of(const Mode& mode, int k) {
  double best = -std::numeric_limits<double>::infinity();
  for (const Eigen::ArrayXd& slack : mode.slack)
    best = std::max(best, run_slack_above(0.0, slack, k, FrameMask(slack.size(), true)));
  return best;
}

void add_values(const HandDistances& d, DetectorResult& result) {
  result.values["hands_distance_min"] = d.hands.minCoeff();
  result.values["torso_distance_min"] = d.left_torso.min(d.right_torso).minCoeff();
  result.values["torso_distance_both_min"] = d.left_torso.max(d.right_torso).minCoeff();
  if (d.left_shoulder.size() == 0) return;
  result.values["shoulder_distance_min"] = d.left_shoulder.min(d.right_shoulder).minCoeff();
  result.values["shoulder_distance_both_min"] = d.left_shoulder.max(d.right_shoulder).minCoeff();
}

// The double embrace uses both thresholds; `body` is the single embrace's unless that is off.
void add_distance_margins(const HandDistances& d, const Mode& single, const Mode& shoulder, const Thresholds& tau,
                          DetectorResult& result) {
  const int k = frames_needed(tau.at("min_frames"));
  const Eigen::ArrayXd farther = d.left_torso.max(d.right_torso);
  result.margins["hand_dist"] = run_slack_below(tau.at("hand_dist"), d.hands, k, below(farther, tau.at("body")));
  result.margins["body"] = single.holds.empty()
                               ? run_slack_below(tau.at("body"), farther, k, below(d.hands, tau.at("hand_dist")))
                               : margin_of(single, k);
  if (!shoulder.holds.empty()) result.margins["shoulder"] = margin_of(shoulder, k);
}

// Algorithm 1. Parts double_embrace, single_embrace, shoulder_embrace. Evidence: frames at which one of them holds.
// Margins of hand_dist, body and shoulder are of their own mode; "overall" is the best mode's and decides.
DetectorResult detect_hug(const Agent& performer, const Agent& partner, const Thresholds& tau,
                          const DetectorReadings& readings) {
  const HandDistances d = hand_distances(performer, partner, readings.hug_shoulder);
  const Mode modes[] = {double_mode(d, tau.at("hand_dist"), tau.at("body")),
                        single_mode(d, tau.at("body"), readings.hug_single),
                        shoulder_mode(d, tau.at("shoulder"), readings.hug_shoulder)};
  constexpr const char* kNames[] = {"double", "single", "shoulder"};
  const double min_frames = tau.at("min_frames");

  DetectorResult result;
  result.frames.assign(d.hands.size(), false);
  double overall = -std::numeric_limits<double>::infinity();
  int longest = 0;
  for (int i = 0; i < 3; ++i) {
    const std::string name = kNames[i];
    const int run = run_of(modes[i]);
    const bool embraced = !modes[i].holds.empty() && run >= min_frames;
    result.success = result.success || embraced;
    result.parts[name + "_embrace"] = embraced;
    result.values[name + "_run"] = run;
    for (const FrameMask& holds : modes[i].holds) result.frames = either(result.frames, holds);
    overall = std::max(overall, margin_of(modes[i], frames_needed(min_frames)));
    longest = std::max(longest, run);
  }
  add_values(d, result);
  add_distance_margins(d, modes[1], modes[2], tau, result);
  result.margins["min_frames"] = longest - min_frames;
  result.margins["overall"] = overall;
  return result;
}

constexpr auto kHugThresholds = std::to_array<ThresholdInfo>({
    {"hand_dist", 0.5, 0.5, "m", "double embrace: the two hands are nearer to one another"},
    {"body", 0.45, 0.45, "m", "double embrace: both hands are nearer to the torso; single embrace: one hand is"},
    {"shoulder", 0.4, 0.4, "m", "shoulder embrace: both hands are nearer to their nearer shoulder"},
    {"min_frames", 3, 25, "frames", "one way to embrace lasts so many frames on end"},
});

constexpr auto kHugFigures = std::to_array<DetectorFigure>({
    {"double_run", "frames", "longest run of the double embrace"},
    {"single_run", "frames", "longest run of the single embrace"},
    {"shoulder_run", "frames", "longest run of the shoulder embrace"},
    {"hands_distance_min", "m", "least distance of the two hands from one another"},
    {"torso_distance_min", "m", "least distance of the nearer hand from the torso"},
    {"torso_distance_both_min", "m", "least distance from the torso that both hands keep at once"},
    {"shoulder_distance_min", "m", "least distance of the nearer hand from its nearer shoulder"},
    {"shoulder_distance_both_min", "m",
     "least distance from their nearer shoulders that both hands keep at once: decides under hug.shoulder=both_hands"},
});

constexpr auto kHugPhrases = std::to_array<TaskPhrase>({
    {"hug", 1.0},
    {"embrace", 1.0},
    {"cuddle", 1.0},
    {"squeeze", 0.8},
    {"snuggle", 1.0},
    {"arms around", 1.0},
    {"open arms", 1.0},
    {"wrap", 0.6},
    {"hold close", 1.0},
    {"hold tight", 1.0},
    {"pull close", 1.0},
});

constexpr auto kHugParaphrases = std::to_array<std::string_view>({
    "give the person a hug",
    "hug them",
    "embrace your partner",
    "wrap your arms around the person",
    "put both arms around him",
    "cuddle with the person in front of you",
    "hold her tight for a moment",
    "share a warm embrace",
    "go in for a hug",
    "squeeze the person gently",
    "welcome them with open arms",
    "hugging the human",
});

}  // namespace

namespace tasks {

// People lean into a hug, and hands that go round one another pass.
constexpr auto kHugIncludes = std::to_array<std::string_view>({"bend", "high_five"});

const TaskDefinition& hug() {
  static constexpr TaskDefinition kDefinition = {
      .name = "hug",
      .prompt = "hug the person",
      .paraphrases = kHugParaphrases,
      .phrases = kHugPhrases,
      .phases = {.act = ActSignal::kHandAtChest},
      .act = {.mean_seconds = 25.9,
              .shortest = 4.5,
              .longest = 13.0,
              .release = 1.6,
              .lowest = 1.05,
              .highest = 1.25,
              .touch_distance = 0.25,
              .close = true,
              .layout = synthesis::hug_layout,
              .perform = synthesis::perform_hug,
              .recorded = synthesis::kRecordedHug,
              .varied = synthesis::varied_hug(synthesis::kRecordedHug)},
      .detector = {.thresholds = kHugThresholds, .figures = kHugFigures, .tracks = hug_tracks, .detect = detect_hug},
      .rule = &rules::kHug,
      .interaction = {.touch = Touch::kArmsRoundTrunk, .touch_s = 0.5, .includes = kHugIncludes}};
  return kDefinition;
}

}  // namespace tasks
}  // namespace duet
