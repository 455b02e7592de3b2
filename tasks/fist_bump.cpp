// Fist bump: one holds a fist out at waist to chest height, the other's meets it, both draw back, perhaps with a little
// explosion of the hands, and part. The supplement does not have it: words, act, detector and thresholds are duet's
// own.
//
// The detector sees no grasp: what tells a fist bump from a handshake is how briefly the hands are together, from a
// high-five how high they are, from the arms of a hug that both stand back. Both sets of thresholds ask for the
// definition (hands together for 0.2 to 1 s, 0.8 to 1.3 m above the ground, then apart). Contact of tracks lasts longer
// than that of fists, which come and go within the threshold: hence 1.5 s at most.
#include <algorithm>
#include <cmath>

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/evidence.h"
#include "duet/tasks/synthesis/act.h"
#include "duet/tasks/synthesis/varied.h"
#include "duet/tasks/task_definition.h"

namespace duet::synthesis {
namespace {

constexpr double kFistRaise = 0.8;                          // [s]
constexpr double kExplode = 0.55;                           // the hands fly back from one another [s]
constexpr double kKnuckles = 0.03;                          // from the hand joint to the front of the fist [m]
constexpr double kLowestTouch = 0.82;                       // [m]
constexpr double kHighestTouch = 1.26;                      // [m]
const Eigen::Vector3d kFistPole(-0.35, 0.45, -1.0);         // the elbow is low, the forearm nearly level
constexpr double kStraightWrist = 0.0, kOpenWrist = -0.30;  // [rad]

Hold held_near(const Eigen::Vector3d& point, double wrist) {
  return [=](const Moment& m) {
    ArmPose arm;
    arm.hand = point + 0.008 * m.sway;
    arm.pole = chest_vector(m, kFistPole);
    arm.wrist = wrist;
    return arm;
  };
}

// When the fists meet and part. [s]
struct Bump {
  double strike = 0.0, touch = 0.0, away = 0.0;
  bool explodes = false;
};

Bump plan_bump(const Scene& scene, Draws& draws) {
  const double touch = scene.cast.manner.contact.value_or(draws.styled("touch", 1.0 - scene.cast.style, 0.34, 0.90));
  const double strike = draws.styled("strike", 1.0 - scene.cast.style, 0.30, 0.48);
  Bump bump;
  bump.explodes = draws.chance("explodes", 0.3);
  bump.away = scene.act_end - (bump.explodes ? kExplode : 0.0);
  bump.touch = bump.away - touch;
  bump.strike = bump.touch - strike;
  return bump;
}

Layout fist_bump_layout(const Participants& cast, Draws& draws) {
  const double stature = 0.5 * (cast.body[0].height + cast.body[1].height);
  const double share = draws.uniform("target.share", 0.55, 0.70);
  const double z = cast.target_height.value_or(std::clamp(share * stature, kLowestTouch, kHighestTouch));
  draws.record("target_height", z);
  Lean lean;
  lean.forward = draws.styled("lean", cast.style, 0.02, 0.10);
  lean.twist = -side_sign(cast.side) * draws.uniform("twist", 0.08, 0.20);
  return meeting_layout(cast, z, draws.uniform("reach.share", 0.80, 0.88), 0.45, 0.64, lean);
}

void perform_fist_bump(Scene& scene, Draws& draws) {
  const int side = scene.cast.side;
  const Bump bump = plan_bump(scene, draws);
  const double back = draws.styled("swing", scene.cast.style, 0.12, 0.22);
  const double answer = draws.uniform("b.answers", 0.0, 1.0);  // 0: at once; 1: just in time
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const Eigen::Vector3d meet = seen_by(k, scene.layout, scene.layout.meet);
    const auto from_meet = [&](double ahead, double up) {
      return in_world(person.act, meet + Eigen::Vector3d(ahead, side_sign(side) * 0.04, up));
    };
    const Eigen::Vector3d contact = in_world(person.act, meet - Eigen::Vector3d(kKnuckles, 0.0, 0.0));
    const Hold at_contact = at_point([p = Eigen::Vector3d(contact)](double) { return p; }, kFistPole, kStraightWrist);
    ArmTrack& arm = person.arms[side];
    const double first = scene.act_begin + person.reaction;
    const double begin = first + k * answer * std::max(0.0, bump.strike - kFistRaise - first);
    arm.to(begin, begin + kFistRaise, held_near(from_meet(-back, -0.03), kStraightWrist), {0.06, 0.05, 0.0});
    arm.to(bump.strike, bump.touch, at_contact, {0.0, 0.0, 0.02});
    if (bump.explodes)
      arm.to(bump.away, scene.act_end, held_near(from_meet(-1.6 * back, 0.10), kOpenWrist), {0.0, 0.06, 0.03});
    arm.rest(scene.act_end, scene.release_end, {0.04, 0.06, 0.0});
    person.lean_to(begin, bump.touch, scene.layout.lean[k]);
    person.lean_to(bump.away, scene.release_end, {});
  }
  const int hand = sided(kLeftHand, side);
  scene.touches.push_back({bump.touch, bump.away, hand, hand});
}

}  // namespace
}  // namespace duet::synthesis

namespace duet {
namespace {

Tracks fist_bump_tracks(const Agent& performer, const Agent& partner, const DetectorReadings&) {
  Tracks tracks = hands_of("performer", performer);
  append(tracks, hands_of("partner", partner));
  append(tracks, {{"performer.root", &performer.root}, {"partner.root", &partner.root}});
  return tracks;
}

// The middle between the nearest hands, (3, T). [m]
Eigen::Matrix3Xd middles(const ClosestHands& closest, const Agent& performer, const Agent& partner) {
  Eigen::Matrix3Xd middle(3, closest.distance.size());
  for (Eigen::Index t = 0; t < middle.cols(); ++t) {
    const Eigen::Matrix3Xd& own = closest.performer_right[t] ? performer.rhand : performer.lhand;
    const Eigen::Matrix3Xd& other = closest.partner_right[t] ? partner.rhand : partner.lhand;
    middle.col(t) = 0.5 * (own.col(t) + other.col(t));
  }
  return middle;
}

// The largest distance of the hands after the last frame of `touching`; of all frames where there is none.
double parted_distance(const Eigen::ArrayXd& distance, const FrameMask& touching) {
  Eigen::Index after = distance.size();
  while (after > 0 && !touching[after - 1]) --after;
  return after == distance.size() ? distance[after - 1] : distance.tail(distance.size() - after).maxCoeff();
}

// Parts touch, brief, parted. Evidence: frames of touch at a valid height and far enough from both.
DetectorResult detect_fist_bump(const Agent& performer, const Agent& partner, const Thresholds& tau,
                                const DetectorReadings&) {
  const ClosestHands closest = closest_hands(performer, partner);
  const Eigen::ArrayXd& d = closest.distance;
  const Eigen::Matrix3Xd middle = middles(closest, performer, partner);
  const Eigen::ArrayXd z = middle.row(2).transpose().array();
  const Eigen::ArrayXd from_roots = distances(middle, performer.root).min(distances(middle, partner.root));
  const FrameMask touching = below(d, tau.at("contact")), far = at_least(from_roots, tau.at("min_dist"));
  const FrameMask high = at_least(z, tau.at("lowest")), low = at_most(z, tau.at("highest"));
  const FrameMask in_place = both(far, both(high, low));
  const FrameMask valid = both(touching, in_place);
  const int run = longest_run(valid), together = longest_run(touching);
  const double parted = parted_distance(d, touching);
  Eigen::Index nearest = 0;
  const double least = d.minCoeff(&nearest);

  DetectorResult result;
  result.frames = valid;
  result.parts["touch"] = run >= tau.at("min_touch");
  result.parts["brief"] = together <= tau.at("max_touch");
  result.parts["parted"] = parted >= tau.at("part");
  result.success = result.parts["touch"] && result.parts["brief"] && result.parts["parted"];
  result.values = {{"distance_min", least}, {"touch_height", z[nearest]}, {"root_distance", from_roots[nearest]},
                   {"touch_run", run},      {"together_run", together},   {"parted_distance", parted}};
  const int k = frames_needed(tau.at("min_touch"));
  result.margins = {{"contact", run_slack_below(tau.at("contact"), d, k, in_place)},
                    {"lowest", run_slack_above(tau.at("lowest"), z, k, both(touching, both(low, far)))},
                    {"highest", run_slack_below(tau.at("highest"), z, k, both(touching, both(high, far)))},
                    {"min_dist", run_slack_above(tau.at("min_dist"), from_roots, k, both(touching, both(high, low)))},
                    {"min_touch", run - tau.at("min_touch")},
                    {"max_touch", tau.at("max_touch") - together},
                    {"part", parted - tau.at("part")}};
  return result;
}

constexpr auto kFistBumpThresholds = std::to_array<ThresholdInfo>({
    {"contact", 0.2, 0.12, "m", "the nearest hands of the two are nearer"},
    {"lowest", 0.8, 0.8, "m", "their middle is at least so high above the ground"},
    {"highest", 1.3, 1.3, "m", "their middle is at most so high above the ground"},
    {"min_dist", 0.35, 0.35, "m", "their middle is at least so far from either root"},
    {"min_touch", 10, 10, "frames", "contact at such a place, frames on end, at least"},
    {"max_touch", 75, 75, "frames", "contact anywhere, frames on end, at most"},
    {"part", 0.3, 0.4, "m", "after the last contact the hands come at least so far apart"},
});

constexpr auto kFistBumpFigures = std::to_array<DetectorFigure>({
    {"distance_min", "m", "least distance of the nearest hands"},
    {"touch_height", "m", "height of their middle above the ground where they are nearest"},
    {"root_distance", "m", "distance of their middle from the nearer root there"},
    {"touch_run", "frames", "longest contact at a valid place"},
    {"together_run", "frames", "longest contact anywhere"},
    {"parted_distance", "m", "largest distance of the nearest hands after the last contact"},
});

constexpr auto kFistBumpPhrases = std::to_array<TaskPhrase>({
    {"fist bump", 1.0},
    {"fistbump", 1.0},
    {"bump fist", 1.0},
    {"pound fist", 1.0},
    {"touch fist", 1.0},
    {"knock fist", 1.0},
    {"fist", 0.9},
    {"bump", 0.7},
    {"knuckle", 0.9},
    {"bump knuckle", 1.0},
    {"touch knuckle", 1.0},
});

constexpr auto kFistBumpParaphrases = std::to_array<std::string_view>({
    "bump fists with the person",
    "give the person a fist bump",
    "fist-bump them",
    "touch fists with your partner",
    "a quick fistbump",
    "hold out your fist to her",
    "bump knuckles with him",
    "greet the person with your fist",
    "knock fists together",
    "fist bumping the human",
    "pound your fist against his",
    "bump it",
});

}  // namespace

namespace tasks {

const TaskDefinition& fist_bump() {
  static constexpr TaskDefinition kDefinition = {
      .name = "fist_bump",
      .prompt = "bump fists with the person",
      .paraphrases = kFistBumpParaphrases,
      .phrases = kFistBumpPhrases,
      .phases = {.act = ActSignal::kHandsTogether, .onset = OnsetSignal::kHandsUp},
      .act = {.mean_seconds = 17.0,
              .shortest = 3.2,
              .longest = 5.5,
              .release = 1.0,
              .lowest = synthesis::kLowestTouch,
              .highest = synthesis::kHighestTouch,
              .touch_distance = 0.08,
              .close = false,
              .layout = synthesis::fist_bump_layout,
              .perform = synthesis::perform_fist_bump,
              .recorded = {.tempo = {1.2, 1.5, 1.8}, .way = {0.0, 0.2, 0.5}},
              .varied = synthesis::varied_strike({0.2, 0.4, 0.9})},
      .detector = {.thresholds = kFistBumpThresholds,
                   .figures = kFistBumpFigures,
                   .tracks = fist_bump_tracks,
                   .detect = detect_fist_bump},
      .rule = &rules::kFistBump,
      .interaction = {.touch = Touch::kHands, .touch_s = 0.002, .ghost_hands = 0.10, .onset = ActOnset::kHandRises}};
  return kDefinition;
}

}  // namespace tasks
}  // namespace duet
