// Fly-kiss: hand to the mouth, then out towards the partner, who may catch it first and sends one back.
//
// Printed: any hand near the head at any time, and forward steps of that hand anywhere in the clip. Table S11 calls the
// forward motion "Phase 2", hence the readings that look only after the hand was at the head.
#include <algorithm>
#include <cmath>

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/evidence.h"
#include "duet/tasks/synthesis/act.h"
#include "duet/tasks/synthesis/varied.h"
#include "duet/tasks/task_definition.h"

namespace duet::synthesis {
namespace {

constexpr double kToMouth = 0.8, kForward = 0.75;                                // [s]
constexpr double kCatch = 0.65, kCaught = 0.25, kToHeart = 0.6, kAtHeart = 0.5;  // [s]

// Fingertips at the lips, so the knuckles are in front of the chin.
Hold at_mouth() {
  return [](const Moment& m) {
    const double h = m.body.height;
    ArmPose arm;
    arm.hand = m.own.p.col(kHead) +
               m.own.R[kHead] * Eigen::Vector3d(0.068 * h, side_sign(m.side) * 0.022 * h, -0.045 * h) + 0.004 * m.sway;
    arm.pole = chest_vector(m, {-0.1, 0.9, -1.0});
    arm.wrist = 0.45;
    return arm;
  };
}

Hold at_heart() {
  return [](const Moment& m) {
    const double h = m.body.height;
    ArmPose arm;
    arm.hand = m.own.p.col(kSpine3) + chest_vector(m, {0.095 * h, 0.02 * h, 0.03 * h}) + 0.004 * m.sway;
    arm.pole = chest_vector(m, {-0.2, 0.9, -1.0});
    arm.wrist = 0.4;
    return arm;
  };
}

// Palm up, arm nearly stretched towards the partner, at `height` above the ground.
Hold blown(double height) {
  return [=](const Moment& m) {
    const double share = 0.84;
    const Eigen::Vector3d shoulder = m.own.p.col(sided(kLeftShoulder, m.side));
    const double up = height - shoulder.z();
    const double level = std::sqrt(std::max(std::pow(share * m.body.arm(), 2) - up * up, 0.04));
    const Eigen::Vector3d ahead = chest_vector(m, {1.0, -0.15, 0.0});
    ArmPose arm;
    arm.hand = shoulder + level * ahead.normalized() + 0.007 * m.sway;
    arm.hand.z() = height + 0.007 * m.sway.z();
    arm.pole = chest_vector(m, {-0.3, 0.5, -1.0});
    arm.wrist = -0.25;
    return arm;
  };
}

Layout fly_kiss_layout(const Participants& cast, Draws& draws) {
  Layout layout;
  layout.distance = std::min(draws.uniform("act.distance", 1.2, 2.1), cast.farthest);
  if (cast.manner.distance) layout.distance = *cast.manner.distance;
  for (Lean& lean : layout.lean) lean.forward = draws.styled("lean", cast.style, 0.02, 0.12);
  stand_at_bearings(cast, layout);
  return layout;
}

void perform_fly_kiss(Scene& scene, Draws& draws) {
  const int side = scene.cast.side;
  const double lips = draws.uniform("lips", 0.4, 0.9);
  const double kiss = kToMouth + lips + kForward;
  const double catching = kCatch + kCaught + kToHeart + kAtHeart;
  const double shown = 0.6;  // the hand stays out at least this long [s]
  const double notice = kToMouth + lips + 0.4 * kForward + scene.people[1].reaction;
  const double room = scene.act_end - scene.act_begin - notice - kiss - shown;
  const bool catches = draws.chance("b.catches", 0.5) && room >= catching;
  draws.record("b.catches", catches ? "yes" : "no");
  const double release = scene.release_end - scene.act_end;
  const double high = draws.styled("target.share", scene.cast.style, 0.76, 0.86);
  const double longest_show = draws.uniform("shown", 0.8, 1.8);
  for (const int k : {0, 1}) {
    Performer& person = scene.people[k];
    ArmTrack& arm = person.arms[side];
    const double height = scene.cast.target_height.value_or(high * person.body.height);
    draws.record(k == 0 ? "a.target_height" : "b.target_height", height);
    double t = k == 0 ? scene.act_begin : scene.act_end - kiss - std::clamp(room, shown, longest_show);
    if (k == 1 && catches) {
      const double start = t - catching;
      arm.to(start, start + kCatch, blown(0.78 * person.body.height), {0.0, 0.05, 0.05});
      arm.to(start + kCatch + kCaught, start + kCatch + kCaught + kToHeart, at_heart());
    }
    arm.to(t, t + kToMouth, at_mouth(), {0.12, 0.04, 0.0});
    arm.to(t + kToMouth + lips, t + kiss, blown(height), {0.0, 0.0, -0.03});
    person.lean_to(t + kToMouth + lips, t + kiss, scene.layout.lean[k]);
    const double back = k == 0 ? t + kiss + longest_show : scene.act_end;
    arm.rest(back, back + release, {0.08, 0.05, 0.0});
    person.lean_to(back, back + release, {});
  }
}

}  // namespace
}  // namespace duet::synthesis

namespace duet {
namespace {

Tracks fly_kiss_tracks(const Agent& performer, const Agent& partner, const DetectorReadings&) {
  Tracks tracks = hands_of("performer", performer);
  tracks.push_back({"performer.head", &performer.head});
  tracks.push_back({"performer.root", &performer.root});
  tracks.push_back({"partner.root", &partner.root});
  return tracks;
}

// Unit vector from the performer's mean root to the partner's; zero where they coincide: no step is forward then.
Eigen::Vector3d forward_direction(const Agent& performer, const Agent& partner, FlyKissDirection reading) {
  Eigen::Vector3d direction = partner.root.rowwise().mean() - performer.root.rowwise().mean();
  if (reading == FlyKissDirection::kHorizontal) direction.z() = 0.0;
  const double length = direction.norm();
  return length > 0.0 ? Eigen::Vector3d(direction / length) : Eigen::Vector3d::Zero();
}

// First frame from which steps count; one past the last where none do.
Eigen::Index first_counted(const Eigen::ArrayXd& to_head, double hand2head, FlyKissOrder reading) {
  Eigen::Index frame = 0;
  if (reading == FlyKissOrder::kAfterClosest) {
    to_head.minCoeff(&frame);
  } else if (reading == FlyKissOrder::kAfterFirstClose) {
    while (frame < to_head.size() && to_head[frame] > hand2head) ++frame;
  }
  return frame;
}

// Algorithm 6. Parts condition_A, condition_B. Evidence: frames with the hand at the head or arrived at by a forward
// step.
DetectorResult detect_fly_kiss(const Agent& performer, const Agent& partner, const Thresholds& tau,
                               const DetectorReadings& readings) {
  const Eigen::ArrayXd left = distances(performer.lhand, performer.head);
  const Eigen::ArrayXd right = distances(performer.rhand, performer.head);
  const bool left_active = left.minCoeff() <= right.minCoeff();
  const Eigen::ArrayXd& to_head = left_active ? left : right;
  Eigen::Matrix3Xd hand = left_active ? performer.lhand : performer.rhand;
  if (readings.fly_kiss_frame == MotionFrame::kRoot) hand -= performer.root;

  const Eigen::Index frames = hand.cols();
  const Eigen::Vector3d direction = forward_direction(performer, partner, readings.fly_kiss_dir);
  const Eigen::Index first = first_counted(to_head, tau.at("hand2head"), readings.fly_kiss_order);
  FrameMask forward(frames);  // the step that ends at this frame
  double total = 0.0;
  for (Eigen::Index t = first + 1; t < frames; ++t) {
    const double step = (hand.col(t) - hand.col(t - 1)).dot(direction);
    forward[t] = step > 0.0;
    total += std::max(step, 0.0);
  }
  const int run = longest_run(forward);
  const double d_min = to_head.minCoeff();

  DetectorResult result;
  result.frames = either(at_most(to_head, tau.at("hand2head")), forward);
  result.parts["condition_A"] = d_min <= tau.at("hand2head");
  result.parts["condition_B"] = run >= tau.at("min_forward") && total >= tau.at("forward_thresh");
  result.success = result.parts["condition_A"] && result.parts["condition_B"];
  result.values = {{"head_distance_min", d_min}, {"consecutive_forward", run}, {"total_forward_motion", total}};
  result.margins = {{"hand2head", tau.at("hand2head") - d_min},
                    {"min_forward", run - tau.at("min_forward")},
                    {"forward_thresh", total - tau.at("forward_thresh")}};
  return result;
}

void read_fly_kiss_strictly(DetectorReadings& readings) { readings.fly_kiss_order = FlyKissOrder::kAfterClosest; }

constexpr auto kFlyKissThresholds = std::to_array<ThresholdInfo>({
    {"hand2head", 0.3, 0.2, "m", "a hand comes to the head, at most so far from it"},
    {"forward_thresh", 0.1, 0.1, "m", "the hand's forward motion in all, at least"},
    {"min_forward", 5, 5, "frames", "forward steps on end, at least"},
});

constexpr auto kFlyKissFigures = std::to_array<DetectorFigure>({
    {"head_distance_min", "m", "least distance of the active hand from the head"},
    {"consecutive_forward", "frames", "most forward steps on end"},
    {"total_forward_motion", "m", "forward motion of the hand in all"},
});

constexpr auto kFlyKissPhrases = std::to_array<TaskPhrase>({
    {"fly kiss", 1.0},
    {"flying kiss", 1.0},
    {"blow kiss", 1.0},
    {"throw kiss", 1.0},
    {"send kiss", 1.0},
    {"air kiss", 1.0},
    {"kiss", 0.9},
    {"smooch", 0.9},
});

constexpr auto kFlyKissParaphrases = std::to_array<std::string_view>({
    "blow a kiss to the person",
    "send a flying kiss",
    "blow them a kiss",
    "throw a kiss to her",
    "kiss your hand and send it over",
    "make a fly kiss",
    "air kiss",
    "blowing kisses",
    "kiss your palm and blow it to him",
    "send a smooch through the air",
    "give a flying kiss to your partner",
    "a kiss from afar",
});

}  // namespace

namespace tasks {

const TaskDefinition& fly_kiss() {
  static constexpr TaskDefinition kDefinition = {.name = "fly_kiss",
                                                 .prompt = "blow a kiss to the person",
                                                 .paraphrases = kFlyKissParaphrases,
                                                 .phrases = kFlyKissPhrases,
                                                 .phases = {.act = ActSignal::kHandsUp},
                                                 .act = {.mean_seconds = 17.9,
                                                         .shortest = 5.5,
                                                         .longest = 10.0,
                                                         .release = 1.1,
                                                         .lowest = 1.1,
                                                         .highest = 1.5,
                                                         .touch_distance = 0.0,
                                                         .close = false,
                                                         .layout = synthesis::fly_kiss_layout,
                                                         .perform = synthesis::perform_fly_kiss,
                                                         .recorded = {.tempo = {1.3, 1.6, 2.0}, .way = {0.0, 0.1, 0.4}},
                                                         .varied = synthesis::varied_gesture(0.25)},
                                                 .detector = {.thresholds = kFlyKissThresholds,
                                                              .figures = kFlyKissFigures,
                                                              .tracks = fly_kiss_tracks,
                                                              .detect = detect_fly_kiss,
                                                              .read_strictly = read_fly_kiss_strictly},
                                                 .rule = &rules::kFlyKiss,
                                                 .interaction = {.onset = ActOnset::kHandRises}};
  return kDefinition;
}

}  // namespace tasks
}  // namespace duet
