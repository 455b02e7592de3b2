// High-five: raise the hand beside the head, clap once or more, lower it.
//
// ValHandHeight is not printed: by default both hands of the closest pair must be high enough over the performer's
// root.
#include <algorithm>
#include <cmath>

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/evidence.h"
#include "duet/tasks/synthesis/act.h"
#include "duet/tasks/synthesis/varied.h"
#include "duet/tasks/task_definition.h"

namespace duet::synthesis {
namespace {

constexpr double kFiveRaise = 0.9;  // [s]
constexpr double kRebound = 0.4;    // back to where a clap starts [s]
constexpr double kPalm = 0.02;      // from the hand joint to the palm [m]

struct Clap {
  double strike, contact, away;  // start of the strike, first and last instant of contact [s]
};

std::vector<Clap> plan_claps(const Scene& scene, Draws& draws) {
  const double wait = draws.uniform("ready", 0.25, 0.6);
  const double strike = draws.styled("strike", 1.0 - scene.cast.style, 0.24, 0.36);
  const double contact = scene.cast.manner.contact.value_or(draws.uniform("contact", 0.10, 0.18));
  const double first = kFiveRaise + scene.people[1].reaction;
  const double one = wait + strike + contact;
  const double room = scene.act_end - scene.act_begin - first;
  // The last clap ends the act; earlier ones come as far before it as they need.
  const int most = 1 + static_cast<int>(std::max(0.0, (room - one) / (one + kRebound)));
  const int wanted = draws.chance("claps.two", 0.35) ? 2 : 1;
  const int count = std::min({most, wanted, 2});
  draws.record("claps", count);
  std::vector<Clap> claps;
  for (int i = count - 1; i >= 0; --i) {
    const double away = scene.act_end - i * (one + kRebound);
    claps.push_back({away - contact - strike, away - contact, away});
  }
  return claps;
}

// The palm faces the partner: forearm upright, hand bent back.
const Eigen::Vector3d kPole(-0.15, 0.5, -1.0);
constexpr double kWrist = -0.35;

Hold ready_near(const Eigen::Vector3d& point) {
  return [=](const Moment& m) {
    ArmPose arm;
    arm.hand = point + 0.01 * m.sway;
    arm.pole = chest_vector(m, kPole);
    arm.wrist = kWrist;
    return arm;
  };
}

Layout high_five_layout(const Participants& cast, Draws& draws) {
  const double stature = 0.5 * (cast.body[0].height + cast.body[1].height);
  const double shorter = std::min(cast.body[0].height, cast.body[1].height);
  const double high = draws.styled("target.share", cast.style, 0.86, 1.0);
  // The shorter one must get there without a jump.
  const double z = cast.target_height ? *cast.target_height : std::min(high * stature, 1.06 * shorter);
  draws.record("target_height", z);
  Lean lean;
  lean.forward = draws.styled("lean", cast.style, 0.02, 0.08);
  lean.twist = -side_sign(cast.side) * draws.uniform("twist", 0.05, 0.18);
  return meeting_layout(cast, z, draws.uniform("reach.share", 0.80, 0.88), 0.36, 0.60, lean);
}

void perform_high_five(Scene& scene, Draws& draws) {
  const int side = scene.cast.side;
  const std::vector<Clap> claps = plan_claps(scene, draws);
  const double back = draws.styled("swing", scene.cast.style, 0.14, 0.26);
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    const Eigen::Vector3d meet = seen_by(k, scene.layout, scene.layout.meet);
    const Eigen::Vector3d contact = in_world(person.act, meet - Eigen::Vector3d(kPalm, 0.0, 0.0));
    const Eigen::Vector3d ready = in_world(person.act, meet + Eigen::Vector3d(-back, side_sign(side) * 0.08, -0.02));
    const Hold at_contact = at_point([p = Eigen::Vector3d(contact)](double) { return p; }, kPole, kWrist);
    ArmTrack& arm = person.arms[side];
    const double begin = scene.act_begin + person.reaction;
    arm.to(begin, begin + kFiveRaise, ready_near(ready), {0.10, 0.05, 0.0});
    for (size_t i = 0; i < claps.size(); ++i) {
      arm.to(claps[i].strike, claps[i].contact, at_contact, {0.0, 0.0, 0.03});
      if (i + 1 < claps.size()) arm.to(claps[i].away, claps[i].away + kRebound, ready_near(ready));
    }
    arm.rest(scene.act_end, scene.release_end, {0.08, 0.06, 0.0});
    person.lean_to(begin, claps.front().contact, scene.layout.lean[k]);
    person.lean_to(scene.act_end, scene.release_end, {});
  }
  const int hand = sided(kLeftHand, side);
  for (const Clap& clap : claps) scene.touches.push_back({clap.contact, clap.away, hand, hand});
}

}  // namespace
}  // namespace duet::synthesis

namespace duet {
namespace {

Tracks high_five_tracks(const Agent& performer, const Agent& partner, const DetectorReadings&) {
  Tracks tracks = hands_of("performer", performer);
  tracks.push_back({"performer.root", &performer.root});
  append(tracks, hands_of("partner", partner));
  return tracks;
}

// Per frame the height that must reach the threshold. [m]
Eigen::ArrayXd judged_heights(const ClosestHands& closest, const Agent& performer, const Agent& partner,
                              HighFiveHeight reading) {
  const Eigen::ArrayXd own_left = heights(performer.lhand, performer.root);
  const Eigen::ArrayXd own_right = heights(performer.rhand, performer.root);
  const Eigen::ArrayXd other_left = heights(partner.lhand, performer.root);
  const Eigen::ArrayXd other_right = heights(partner.rhand, performer.root);
  if (reading == HighFiveHeight::kPerformerAny) return own_left.max(own_right);
  if (reading == HighFiveHeight::kAnyHand) return own_left.max(own_right).max(other_left.max(other_right));

  Eigen::ArrayXd judged(own_left.size());
  for (Eigen::Index t = 0; t < judged.size(); ++t) {
    const double own = closest.performer_right[t] ? own_right[t] : own_left[t];
    const double other = closest.partner_right[t] ? other_right[t] : other_left[t];
    judged[t] = reading == HighFiveHeight::kPerformerClosest ? own
                : reading == HighFiveHeight::kPartnerClosest ? other
                                                             : std::min(own, other);
  }
  return judged;
}

// Algorithm 3. Parts approach, not_sustained. Evidence: close frames at a valid height.
DetectorResult detect_high_five(const Agent& performer, const Agent& partner, const Thresholds& tau,
                                const DetectorReadings& readings) {
  const bool heights_count = readings.high_five_height != HighFiveHeight::kOff;
  const ClosestHands closest = closest_hands(performer, partner);
  const Eigen::ArrayXd& d = closest.distance;
  const Eigen::ArrayXd height = judged_heights(closest, performer, partner, readings.high_five_height);
  const FrameMask close = below(d, tau.at("contact"));
  const FrameMask high = heights_count ? at_least(height, tau.at("height")) : FrameMask(d.size(), true);

  DetectorResult result;
  result.frames = both(close, high);
  const int count = count_frames(result.frames);
  const int run = longest_run(result.frames);
  result.parts["approach"] = count >= tau.at("min_approach");
  result.parts["not_sustained"] = run <= tau.at("max_sustained");
  result.success = result.parts["approach"] && result.parts["not_sustained"];
  result.values = {{"distance_min", d.minCoeff()}, {"contact_count", count}, {"consecutive_count", run}};

  const int k = frames_needed(tau.at("min_approach"));
  result.margins = {{"contact", count_slack_below(tau.at("contact"), d, k, high)},
                    {"min_approach", count - tau.at("min_approach")},
                    {"max_sustained", tau.at("max_sustained") - run}};
  if (heights_count) {
    result.margins["height"] = count_slack_above(tau.at("height"), height, k, close);
    result.values["height_max"] = height.maxCoeff();
  }
  return result;
}

constexpr auto kHighFiveThresholds = std::to_array<ThresholdInfo>({
    {"contact", 0.4, 0.15, "m", "the nearest hands of the two are nearer"},
    {"min_approach", 1, 1, "frames", "frames of contact at a valid height, at least"},
    {"max_sustained", 1000, 50, "frames", "such frames on end, at most"},
    {"height", 0.3, 0.3, "m", "both hands are at least so high above the performer's root"},
});

constexpr auto kHighFiveFigures = std::to_array<DetectorFigure>({
    {"distance_min", "m", "least distance of the nearest hands"},
    {"contact_count", "frames", "frames of contact at a valid height"},
    {"consecutive_count", "frames", "the most of them on end"},
    {"height_max", "m", "largest height of the judged hands above the performer's root"},
});

constexpr auto kHighFivePhrases = std::to_array<TaskPhrase>({
    {"high five", 1.0},
    {"highfive", 1.0},
    {"five", 0.8},
    {"slap", 0.8},
    {"slap palm", 1.0},
    {"slap hand", 1.0},
    {"clap hand", 1.0},
    {"hit palm", 1.0},
    {"tap palm", 1.0},
    {"touch palm", 1.0},
    {"palm", 0.6},
});

constexpr auto kHighFiveParaphrases = std::to_array<std::string_view>({
    "give the person a high five",
    "high-five them",
    "slap palms with the person",
    "give me five",
    "highfive",
    "raise your hand and slap his palm",
    "clap hands with your partner",
    "hit palms up high",
    "up high, five",
    "celebrate with a high five",
    "touch palms above the head",
    "high fiving the human",
});

}  // namespace

namespace tasks {

const TaskDefinition& high_five() {
  static constexpr TaskDefinition kDefinition = {
      .name = "high_five",
      .prompt = "give the person a high five",
      .paraphrases = kHighFiveParaphrases,
      .phrases = kHighFivePhrases,
      .phases = {.act = ActSignal::kHandsTogether, .onset = OnsetSignal::kHandsUp},
      .act = {.mean_seconds = 16.1,
              .shortest = 2.4,
              .longest = 6.5,
              .release = 1.1,
              .lowest = 1.4,
              .highest = 1.65,
              .touch_distance = 0.05,
              .close = false,
              .layout = synthesis::high_five_layout,
              .perform = synthesis::perform_high_five,
              .recorded = {.tempo = {1.4, 1.7, 2.0}, .way = {0.0, 0.2, 0.5}},
              .varied = synthesis::varied_strike({0.06, 0.2, 0.8})},
      .detector = {.thresholds = kHighFiveThresholds,
                   .figures = kHighFiveFigures,
                   .tracks = high_five_tracks,
                   .detect = detect_high_five},
      .rule = &rules::kHighFive,
      .interaction = {.touch = Touch::kHands, .touch_s = 0.002, .ghost_hands = 0.10, .onset = ActOnset::kHandRises}};
  return kDefinition;
}

}  // namespace tasks
}  // namespace duet
