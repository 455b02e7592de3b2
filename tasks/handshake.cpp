// Handshake: both reach out, clasp at waist height, shake in bouts, hold, let go.
//
// Printed: contact frames are validated by the distance of the hand in contact to the performer's own root (line 10),
// although Table S11 speaks of the distance between the roots (reading `agent_roots`). The stability phase starts again
// from d < contact (line 18) and takes the whole sequence, although rolling values are computed.
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

constexpr double kReach = 1.0;  // from the first movement to the clasp [s]
// Clasped hands pass each other: each hand joint is this far beyond the middle and to its own side. [m]
constexpr double kOverlap = 0.010, kAside = 0.012;

// Found on the 18 handshakes of SBU (docs/synthesis.md).
constexpr RecordedManner kRecordedHandshake = {.tempo = {0.95, 1.25, 1.55},
                                               .touch = {0.85, 1.3, 1.7},
                                               .until_touch = kReach,
                                               .distance = {0.98, 1.08, 1.26},
                                               .bearing = {0.41, 0.70, 0.90},
                                               .turn = {0.12, 0.48, 1.00},
                                               .way = {0.0, 0.04, 0.4},
                                               .speed = {0.5, 0.75, 1.0},
                                               .stands = 0.15,
                                               .overlap = {0.5, 0.75, 1.0},
                                               .reaction = {0.0, 0.2, 0.45},
                                               .left = 0.03,
                                               .before = {0.3, 0.65, 1.1},
                                               .after = {0.33, 0.58, 0.7}};

std::vector<Burst> shake_bouts(double begin, double end, const MotionStyle& manner, Draws& draws) {
  const double rate = draws.uniform("shake.rate_hz", 1.6, 2.4) / std::max(1.0, 0.75 * manner.tempo);
  Random random = draws.stream("shake.bouts");
  std::vector<Burst> bouts;
  double t = begin + random.uniform(0.1, 0.3);
  while (t < end) {
    const double length = (manner.rehearsed ? 3 + random.below(3) : 1 + random.below(2)) / rate;
    if (t + length > end) break;
    bouts.push_back({t, t + length, rate, 0.35 / rate});
    t += length + random.uniform(0.6, 1.6);
  }
  draws.record("shake.bouts", static_cast<double>(bouts.size()));
  return bouts;
}

// With the hips as they stand and as they are turned.
bool in_reach(const Participants& cast, const Layout& layout) {
  for (const int k : {0, 1}) {
    Lean lean = layout.lean[k];
    for (const double hips : {0.0, layout.lean[k].hips}) {
      lean.hips = hips;
      const Eigen::Vector3d shoulder = shoulder_at(cast.body[k], cast.side, lean);
      if ((seen_by(k, layout, layout.meet) - shoulder).norm() > 0.975 * cast.body[k].arm()) return false;
    }
  }
  return true;
}

// People whose distance and turns were drawn apart from each other come nearer until the hands meet.
Layout meeting_within_reach(const Participants& cast, double z, double distance, const Lean& lean, bool comes_nearer) {
  constexpr double kStep = 0.03, kNearest = 0.7;  // [m]
  Layout layout = meeting_at_distance(cast, z, distance, lean);
  while (comes_nearer && distance > kNearest && !in_reach(cast, layout)) {
    distance -= kStep;
    layout = meeting_at_distance(cast, z, distance, lean);
  }
  return layout;
}

Layout handshake_layout(const Participants& cast, Draws& draws) {
  const double stature = 0.5 * (cast.body[0].height + cast.body[1].height);
  const double highest = draws.breadth() > 0.0 ? 0.70 : 0.62;
  const double z = cast.target_height ? *cast.target_height : stature * draws.uniform("target.share", 0.565, highest);
  draws.record("target_height", z);
  const double share = draws.uniform("reach.share", 0.80, 0.87);
  Lean lean;
  lean.forward = draws.styled("lean", cast.style, 0.03, 0.12);
  // A person who has the other before the acting hand has no need to turn the trunk.
  lean.twist = -side_sign(cast.side) *
               (cast.manner.rehearsed ? draws.uniform("twist", 0.10, 0.22) : draws.uniform("twist", -0.04, 0.06));
  if (cast.manner.distance) {
    lean.shift = draws.uniform("shift", 0.06, 0.14);  // onto the front foot; found by the speed of the roots
    return meeting_within_reach(cast, z, *cast.manner.distance + 2.0 * lean.shift, lean, draws.breadth() > 0.0);
  }
  // At least 0.45 m: closer, a hand is at the own belly.
  return meeting_layout(cast, z, share, 0.45, 0.62, lean);
}

void perform_handshake(Scene& scene, Draws& draws) {
  const double clasp = scene.act_begin + kReach;
  const double amplitude = draws.styled("shake.amplitude", scene.cast.style, 0.018, 0.045);
  const std::vector<Burst> bouts = shake_bouts(clasp, scene.act_end - 0.2, scene.cast.manner, draws);
  const int side = scene.cast.side;
  const Eigen::Vector3d middle = in_world(scene.people[0].act, scene.layout.meet);
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const Eigen::Vector3d beyond = rot_z(person.act.yaw) * Eigen::Vector3d(kOverlap, side_sign(side) * kAside, 0.0);
    const auto point = [=](double t) {
      double shake = 0.0;
      for (const Burst& bout : bouts) shake += bout.at(t);
      return Eigen::Vector3d(middle + beyond + Eigen::Vector3d(0.0, 0.0, amplitude * shake));
    };
    const double begin = scene.act_begin + person.reaction;
    person.lean_to(begin, clasp, scene.layout.lean[k]);
    person.hips.to(begin, clasp + 0.25 * (scene.act_end - clasp), scene.layout.lean[k].hips);
    person.hips.to(scene.act_end, scene.release_end, 0.0);
    person.arms[side].to(begin, clasp, at_point(point, {-0.4, 0.45, -1.0}, 0.05), {0.02, 0.04, 0.02});
    person.arms[side].rest(scene.act_end, scene.release_end);
    person.lean_to(scene.act_end, scene.release_end, {});
  }
  const int hand = sided(kLeftHand, side);
  scene.touches.push_back({clasp, scene.act_end, hand, hand});
}

}  // namespace
}  // namespace duet::synthesis

namespace duet {
namespace {

Tracks handshake_tracks(const Agent& performer, const Agent& partner, const DetectorReadings& readings) {
  Tracks tracks = hands_of("performer", performer);
  tracks.push_back({"performer.root", &performer.root});
  append(tracks, hands_of("partner", partner));
  if (readings.handshake_distance == HandshakeDistance::kAgentRoots) tracks.push_back({"partner.root", &partner.root});
  return tracks;
}

constexpr double kUndefined = std::numeric_limits<double>::infinity();
constexpr Eigen::Index kRollingWindow = 10;

Eigen::ArrayXd root_distances(const ClosestHands& closest, const Agent& performer, const Agent& partner,
                              const DetectorReadings& readings) {
  if (readings.handshake_distance == HandshakeDistance::kAgentRoots) return distances(performer.root, partner.root);
  const bool own = readings.handshake_active == HandshakeActive::kPerformerHand;
  const Agent& agent = own ? performer : partner;
  const std::vector<bool>& right = own ? closest.performer_right : closest.partner_right;
  const Eigen::ArrayXd left_distance = distances(agent.lhand, performer.root);
  const Eigen::ArrayXd right_distance = distances(agent.rhand, performer.root);
  Eigen::ArrayXd distance(left_distance.size());
  for (Eigen::Index t = 0; t < distance.size(); ++t) distance[t] = right[t] ? right_distance[t] : left_distance[t];
  return distance;
}

Eigen::ArrayXd at(const Eigen::ArrayXd& values, const FrameMask& mask) {
  Eigen::ArrayXd kept(count_frames(mask));
  for (Eigen::Index t = 0, i = 0; t < values.size(); ++t)
    if (mask[t]) kept[i++] = values[t];
  return kept;
}

struct Spread {
  double std = kUndefined, mean = kUndefined;  // infinite where undefined: no threshold is met then
};

Spread spread(const Eigen::ArrayXd& values, int ddof) {
  const double n = static_cast<double>(values.size());
  if (values.size() == 0) return {};
  const double mean = values.sum() / n;
  if (n <= ddof) return {kUndefined, mean};
  return {std::sqrt((values - mean).square().sum() / (n - ddof)), mean};
}

// One spread for the whole sequence, or one per window of ten (a shorter sequence is one window).
std::vector<Spread> spreads(const Eigen::ArrayXd& sequence, const DetectorReadings& readings) {
  const bool whole = readings.handshake_stability == HandshakeStability::kWhole;
  const Eigen::Index window = whole ? sequence.size() : std::min(kRollingWindow, sequence.size());
  std::vector<Spread> result;
  for (Eigen::Index t = 0; t + window <= sequence.size(); ++t)
    result.push_back(spread(sequence.segment(t, window), readings.handshake_ddof));
  return result;
}

// The spread that decides: of the windows the worst, or for `rolling_any` the one with the most room under both bounds.
Spread deciding(const std::vector<Spread>& windows, const Thresholds& tau, HandshakeStability reading) {
  const auto room = [&](const Spread& s) {
    return std::min(tau.at("std_contact") - s.std, tau.at("mean_contact") - s.mean);
  };
  Spread decides = windows.front();
  for (const Spread& s : windows) {
    if (reading == HandshakeStability::kRollingAny) {
      if (room(s) > room(decides)) decides = s;
    } else {
      decides = {std::max(decides.std, s.std), std::max(decides.mean, s.mean)};
    }
  }
  return decides;
}

// Algorithm 2. Parts contact_phase, stability_phase. Evidence: contact frames at a valid distance.
DetectorResult detect_handshake(const Agent& performer, const Agent& partner, const Thresholds& tau,
                                const DetectorReadings& readings) {
  const ClosestHands closest = closest_hands(performer, partner);
  const Eigen::ArrayXd& d = closest.distance;
  const Eigen::ArrayXd d_root = root_distances(closest, performer, partner, readings);
  const FrameMask touching = below(d, tau.at("contact"));
  const FrameMask far_enough = at_least(d_root, tau.at("min_dist"));
  const FrameMask near_enough = at_most(d_root, tau.at("max_dist"));
  const FrameMask valid = both(touching, both(far_enough, near_enough));
  const double min_contact = tau.at("min_contact");
  const int run = longest_run(valid);
  const int count = count_frames(valid);

  const bool validated = readings.handshake_stability_frames == StabilityFrames::kValidated;
  const Eigen::ArrayXd sequence = at(d, validated ? valid : touching);
  const Spread spread =
      sequence.size() == 0 ? Spread{} : deciding(spreads(sequence, readings), tau, readings.handshake_stability);

  DetectorResult result;
  result.frames = valid;
  result.parts["contact_phase"] = count >= min_contact && run >= min_contact;
  result.parts["stability_phase"] = spread.std < tau.at("std_contact") && spread.mean < tau.at("mean_contact");
  result.success = result.parts["contact_phase"] && result.parts["stability_phase"];
  result.values = {
      {"distance_min", d.minCoeff()},           {"valid_contact_count", count},           {"max_consecutive", run},
      {"root_distance_min", d_root.minCoeff()}, {"root_distance_max", d_root.maxCoeff()}, {"stability_std", spread.std},
      {"stability_mean", spread.mean}};
  const int k = frames_needed(min_contact);
  result.margins = {{"contact", run_slack_below(tau.at("contact"), d, k, both(far_enough, near_enough))},
                    {"min_contact", run - min_contact},
                    {"min_dist", run_slack_above(tau.at("min_dist"), d_root, k, both(touching, near_enough))},
                    {"max_dist", run_slack_below(tau.at("max_dist"), d_root, k, both(touching, far_enough))},
                    {"std_contact", tau.at("std_contact") - spread.std},
                    {"mean_contact", tau.at("mean_contact") - spread.mean}};
  return result;
}

constexpr auto kHandshakeThresholds = std::to_array<ThresholdInfo>({
    {"contact", 0.3, 0.3, "m", "the nearest hands of the two are nearer"},
    {"min_contact", 10, 10, "frames", "frames of contact at a valid distance, also on end"},
    {"min_dist", 0.4, 0.4, "m", "the hand is at least so far from the performer's root"},
    {"max_dist", 1.5, 1.5, "m", "the hand is at most so far from the performer's root"},
    {"std_contact", 0.15, 0.15, "m", "standard deviation of the hands' distance in contact is below"},
    {"mean_contact", 0.45, 0.45, "m", "mean of the hands' distance in contact is below"},
});

constexpr auto kHandshakeFigures = std::to_array<DetectorFigure>({
    {"distance_min", "m", "least distance of the nearest hands"},
    {"valid_contact_count", "frames", "frames of contact at a valid distance"},
    {"max_consecutive", "frames", "the most of them on end"},
    {"root_distance_min", "m", "least distance of hand and root (of the roots: handshake.distance=agent_roots)"},
    {"root_distance_max", "m", "largest such distance"},
    {"stability_std", "m", "standard deviation of the hands' distance in contact"},
    {"stability_mean", "m", "mean of the hands' distance in contact"},
});

constexpr auto kHandshakePhrases = std::to_array<TaskPhrase>({
    {"handshake", 1.0},
    {"shake", 0.7},
    {"shake hand", 1.0},
    {"hand shake", 1.0},
    {"shook", 0.7},
    {"shook hand", 1.0},
    {"greet hand", 1.0},
    {"clasp hand", 1.0},
    {"grasp hand", 1.0},
    {"grip hand", 1.0},
    {"take hand", 1.0},
    {"offer hand", 1.0},
    {"extend hand", 1.0},
    {"reach hand", 1.0},
});

constexpr auto kHandshakeParaphrases = std::to_array<std::string_view>({
    "shake hands with the person",
    "give the person a handshake",
    "greet them with your hand",
    "shake the partner's hand",
    "offer your hand to greet",
    "take his hand and shake it",
    "a formal handshake",
    "extend your right hand and shake",
    "reach out your hand to her",
    "do a hand shake",
    "shaking hands",
    "grasp the person's hand in greeting",
});

}  // namespace

namespace tasks {

// Hands that clasp touch before they do.
constexpr auto kHandshakeIncludes = std::to_array<std::string_view>({"fist_bump"});

const TaskDefinition& handshake() {
  static constexpr TaskDefinition kDefinition = {
      .name = "handshake",
      .prompt = "shake hands with the person",
      .paraphrases = kHandshakeParaphrases,
      .phrases = kHandshakePhrases,
      .phases = {.act = ActSignal::kHandsTogether, .onset = OnsetSignal::kHandsCoverTheGap},
      .act = {.mean_seconds = 22.9,
              .shortest = 3.5,
              .longest = 10.0,
              .release = 1.1,
              .lowest = 0.85,
              .highest = 1.2,
              .touch_distance = 0.05,
              .close = false,
              .layout = synthesis::handshake_layout,
              .perform = synthesis::perform_handshake,
              .recorded = synthesis::kRecordedHandshake,
              .varied = synthesis::varied_handshake(synthesis::kReach)},
      .detector = {.thresholds = kHandshakeThresholds,
                   .figures = kHandshakeFigures,
                   .tracks = handshake_tracks,
                   .detect = detect_handshake},
      .rule = &rules::kHandshake,
      .interaction = {.touch = Touch::kHands,
                      .touch_s = 0.3,
                      .ghost_hands = 0.12,
                      .onset = ActOnset::kHandRises,
                      .includes = kHandshakeIncludes}};
  return kDefinition;
}

}  // namespace tasks
}  // namespace duet
