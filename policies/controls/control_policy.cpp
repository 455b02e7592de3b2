#include "duet/policies/controls/control_policy.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/policies/language.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

using ControlArray = std::array<ControlScript, 10>;
constexpr ControlArray kControls = {
    {{.name = "omni",
      .about = "Blind to the command: a hand at the partner's nearest hand, and all gestures in rounds",
      .distance = 0.70,
      .follows = 0,
      .all_gestures = true,
      .lean_in = 0.28},
     {.name = "canned", .about = "Told the task: the fixed gesture of each task on a timer", .told = true},
     {.name = "servo",
      .about = "Blind to the command: the right hand follows the partner's nearest hand",
      .distance = 0.70,
      .follows = 1},
     {.name = "raised", .about = "Blind to the command: stands with its right hand raised", .raised = true},
     {.name = "walker",
      .about = "Blind to the command: walks up with both arms held out",
      .distance = 0.45,
      .forward = true},
     {.name = "forward", .about = "Blind to the command: stands with both arms held out", .forward = true},
     {.name = "patient",
      .about = "Blind to the command: waits until the partner raises a hand, then its own follows the nearest",
      .distance = 0.70,
      .follows = 1,
      .waits = true},
     {.name = "mirror",
      .about = "Blind to the command: walks up, its arms and trunk do as the partner's",
      .distance = 0.70,
      .mirrors = true},
     {.name = "waiting",
      .about = "Told the task: its fixed gesture once the partner begins, at once where told to be first",
      .waits = true,
      .told = true},
     {.name = "vendor",
      .about = "Told the task: stands, its arms do a preset action by the clock, as a maker's own; looks at nobody",
      .once = true,
      .told = true,
      .preset = true}}};

const ControlScript& control_named(std::string_view name) {
  const auto found = std::ranges::find(kControls, name, &ControlScript::name);
  require(found != kControls.end(), "policy '{}' is no control", name);
  return *found;
}

// The script of `canned` for a task: another control, or a gesture.
ControlScript told_script(Task task) {
  const std::string_view name = to_string(task);
  if (name == "hug") return control_named("walker");
  if (name == "bend") return {.gesture = ControlGesture::kBow};
  if (name == "wave") return {.gesture = ControlGesture::kWave};
  if (name == "fly_kiss") return {.gesture = ControlGesture::kKiss};
  return control_named("servo");
}

// The script of `waiting`: that of `canned`, from the partner's beginning on. Distances and arms of an embrace were
// tried on a development seed (24500).
ControlScript waiting_script(Task task) {
  ControlScript script = told_script(task);
  if (to_string(task) == "hug") script = {.distance = 0.40, .apart = 0.90, .embraces = true};
  if (to_string(task) == "handshake") {
    script.distance = 0.65;
    script.apart = 0.85;
  }
  script.waits = script.once = true;
  return script;
}

// The script of `vendor`: an arm action for each task that the maker of the G1 has one for. The motions are ours; the
// maker's own are not published. There is none for a bow.
ControlScript preset_script(Task task) {
  const std::string_view name = to_string(task);
  ControlGesture gesture = ControlGesture::kNone;
  if (name == "hug") gesture = ControlGesture::kHug;
  if (name == "handshake") gesture = ControlGesture::kShake;
  if (name == "high_five") gesture = ControlGesture::kHighFive;
  if (name == "wave") gesture = ControlGesture::kWave;
  if (name == "fly_kiss") gesture = ControlGesture::kKiss;
  return {.gesture = gesture, .once = true, .preset = true};
}

ControlScript script_of(const ControlScript& declared, Task task) {
  if (!declared.told) return declared;
  if (declared.preset) return preset_script(task);
  return declared.waits ? waiting_script(task) : told_script(task);
}

// One round of `omni`: it bows, from here on it kisses, waves, waves from nearer, begins anew. [s]
struct Round {
  double kiss, wave, near, end;
};
constexpr Round kRound = {1.6, 3.2, 5.0, 7.0};

constexpr double kRaisedHand = 0.12;  // a hand of the partner that rises so far is raised [m]
constexpr double kLeaning = 0.14;     // a trunk of the partner that leans so far more than before bows [rad]
constexpr double kClosing = 0.2;      // of an embrace, a plan [1]
constexpr double kAdvance = 0.45, kRetreat = 0.4;  // [m/s]
constexpr double kTurn = 0.7;                      // [rad/s]
constexpr double kWaist = 0.5, kPitch = 0.35;      // of a bow [rad]
constexpr double kWaveRate = 1.5;                  // [Hz]
constexpr int kPlanned = 100;                      // ticks
// Times of a preset action: until its arms are where they act, that they are held there at most, that a wave lasts [s];
// how often hands are shaken [Hz].
constexpr double kPresetUp = 0.8, kPresetHeld = 20.0, kPresetWave = 5.0, kShakeRate = 1.5;

double smooth(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

double wrapped(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi); }

}  // namespace

std::span<const ControlScript> control_scripts() { return kControls; }

bool is_control(std::string_view policy) {
  return std::ranges::any_of(kControls, [&](const ControlScript& script) { return script.name == policy; });
}

std::vector<std::string> control_names() { return names_of(kControls); }

PolicyMaker control_maker(std::string_view name, std::shared_ptr<const RobotModel> robot) {
  require(robot != nullptr, "policy '{}' needs a robot", name);
  const ControlScript& script = control_named(name);
  static_cast<void>(ControlPolicy(robot, script));  // a robot that does not fit is found here
  return [robot = std::move(robot), &script] { return std::make_unique<ControlPolicy>(robot, script); };
}

ControlPolicy::ControlPolicy(std::shared_ptr<const RobotModel> robot, const ControlScript& script)
    : robot_(std::move(robot)), name_(script.name), script_(script), now_(script), arms_(robot_, name_) {
  const double arm = arms_.length(1);
  const Eigen::Vector3d head = arms_.head(), right = arms_.shoulder(1);
  for (const int side : {0, 1})
    poses_.forward[side] =
        arms_.reached(side, arms_.shoulder(side) + arm * Eigen::Vector3d(0.85, side == 0 ? -0.05 : 0.05, -0.12));
  for (const int side : {0, 1}) {
    const double out = side == 0 ? arm : -arm;
    poses_.open[side] = arms_.reached(side, arms_.shoulder(side) + Eigen::Vector3d(0.6 * arm, 0.35 * out, 0.1 * arm));
    poses_.closed[side] =
        arms_.reached(side, arms_.shoulder(side) + Eigen::Vector3d(0.6 * arm, -0.2 * out, 0.15 * arm));
  }
  poses_.raised = arms_.reached(1, right + arm * Eigen::Vector3d(0.55, -0.15, 0.55));
  poses_.wave_out = arms_.reached(1, right + arm * Eigen::Vector3d(0.40, -0.50, 0.50));
  poses_.wave_in = arms_.reached(1, right + arm * Eigen::Vector3d(0.45, 0.10, 0.50));
  poses_.offered = arms_.reached(1, right + arm * Eigen::Vector3d(0.75, 0.15, -0.30));
  poses_.shaken = arms_.reached(1, right + arm * Eigen::Vector3d(0.75, 0.15, -0.20));
  poses_.mouth = arms_.reached(1, head + arm * Eigen::Vector3d(0.30, -0.10, -0.05));
  poses_.blown = arms_.reached(1, right + arm * Eigen::Vector3d(0.85, 0.05, 0.15));
  reset({});
}

void ControlPolicy::reset(const EpisodeContext& context) {
  start_ = robot_->standing_state(context.start.X_WB);
  now_ = script_of(script_, context.task);
  followed_ = robot_->neutral;
  partner_.reset();
  const bool first = now_.gesture != ControlGesture::kNone && is_leading(context.prompt);
  awake_ = !now_.waits || first;
  now_.once = now_.once && (!first || now_.preset);
  least_lean_ = std::numeric_limits<double>::infinity();
  begun_ = closing_ = 0.0;
  served_ = 1.0;
  leaning_ = 0.0;
}

Anchors ControlPolicy::act(const Observation& observation) {
  const std::vector<Reference> references = plan(observation);
  Anchors anchors;
  for (int i = 0; i < kAnchors; ++i)
    anchors[i] = references[static_cast<std::size_t>(std::min(i * kTicksPerAnchor, kPlanned - 1))];
  return anchors;
}

std::vector<Reference> ControlPolicy::plan(const Observation& observation) {
  const ObservationFrame& frame = observation.now();
  const Place where = place(frame);
  partner_.look(frame);
  if (!awake_) watch(frame, observation.tick);
  if (now_.embraces && awake_ && where.distance < now_.distance + 0.1) closing_ = std::min(1.0, closing_ + kClosing);
  if (now_.follows >= 0) follow(frame);
  if (now_.mirrors) mirror(frame, where);
  std::vector<Reference> references;
  references.reserve(kPlanned);
  for (int i = 0; i < kPlanned; ++i) references.push_back(reference(where, (observation.tick + i) / 50.0, i / 50.0));
  return references;
}

ControlPolicy::Place ControlPolicy::place(const ObservationFrame& frame) {
  const Pose& X_WB = frame.robot.X_WB;
  const Eigen::Vector2d to_partner = (frame.partner.col(0) - X_WB.p).head<2>();
  const double distance = std::max(to_partner.norm(), 1e-6);
  return {X_WB.p, yaw_of(X_WB.R), std::atan2(to_partner.y(), to_partner.x()), to_partner / distance, distance};
}

// The hand of the partner that is nearest to the robot's root, a raised one before a hanging one.
void ControlPolicy::follow(const ObservationFrame& frame) {
  const Pose& X_WB = frame.robot.X_WB;
  const Pose X_WY{yaw_rotation(yaw_of(X_WB.R)), X_WB.p};
  const auto cost = [&](int joint) {
    return (frame.partner.col(joint) - X_WB.p).norm() - 0.5 * frame.partner(2, joint);
  };
  const int hand = cost(kLeftHand) <= cost(kRightHand) ? kLeftHand : kRightHand;
  const int side = now_.follows;
  arms_.stretch(side, X_WY.inverse() * Eigen::Vector3d(frame.partner.col(hand)) - arms_.shoulder(side), true,
                followed_);
  if (now_.once) served_ = smooth(partner_.rise(hand == kLeftHand ? 0 : 1) / kRaisedHand - 0.5);
}

// Arms from the shoulders and the trunk from the root, each in the frame of who faces the other; the robot's own size.
void ControlPolicy::mirror(const ObservationFrame& frame, const Place& place) {
  const Eigen::Quaterniond R_PW = yaw_rotation(place.face + std::numbers::pi).conjugate();
  const auto part = [&](int from, int to) -> Eigen::Vector3d {
    return R_PW * Eigen::Vector3d(frame.partner.col(to) - frame.partner.col(from));
  };
  constexpr std::array<std::array<int, 4>, 2> kArms = {
      {{kLeftShoulder, kLeftElbow, kLeftWrist, kLeftHand}, {kRightShoulder, kRightElbow, kRightWrist, kRightHand}}};
  for (const int side : {0, 1}) {
    const auto& arm = kArms[side];
    const double length = part(arm[0], arm[1]).norm() + part(arm[1], arm[2]).norm() + part(arm[2], arm[3]).norm();
    arms_.stretch(side, part(arm[0], arm[3]) * (arms_.length(side) / std::max(length, 1e-6)), false, followed_);
  }
  const Eigen::Vector3d trunk = part(0, kHead);
  leaning_ = std::clamp(std::atan2(trunk.x(), trunk.z()) / (kWaist + kPitch), 0.0, 1.0);
}

void ControlPolicy::watch(const ObservationFrame& frame, int tick) {
  for (const int side : {0, 1}) awake_ = awake_ || partner_.height[side] >= partner_.lowest[side] + kRaisedHand;
  const Eigen::Vector3d trunk = frame.partner.col(kHead) - frame.partner.col(0);
  const double lean = std::atan2(trunk.head<2>().norm(), trunk.z());
  least_lean_ = std::min(least_lean_, lean);
  if (now_.gesture == ControlGesture::kBow && lean >= least_lean_ + kLeaning) awake_ = true;
  if (awake_) begun_ = tick / 50.0;
}

double ControlPolicy::gesture_time(double seconds) const {
  return now_.once ? seconds - begun_ : std::fmod(seconds - begun_, 4.0);
}

double ControlPolicy::bow(double seconds) const {
  if (now_.mirrors) return leaning_;
  if (now_.all_gestures) {
    const double t = std::fmod(seconds, kRound.end);
    return smooth(t / 0.6) * smooth((kRound.kiss - t) / 0.6);
  }
  if (now_.gesture != ControlGesture::kBow || !awake_) return 0.0;
  const double t = gesture_time(seconds);
  return smooth(t / 0.8) * smooth((3.0 - t) / 0.8);
}

Eigen::VectorXd ControlPolicy::pose(double seconds) const {
  Eigen::VectorXd q = robot_->neutral;
  const double round = std::fmod(seconds, kRound.end);
  if (now_.forward)
    for (const int side : {0, 1}) copy_arm(side, poses_.forward[side], 1.0, q);
  if (now_.embraces && awake_)
    for (const int side : {0, 1}) {
      copy_arm(side, poses_.open[side], smooth((seconds - begun_) / 0.8), q);
      copy_arm(side, poses_.closed[side], smooth(closing_), q);
    }
  if (now_.raised) copy_arm(1, poses_.raised, 1.0, q);
  if (now_.follows >= 0 && awake_) copy_arm(now_.follows, followed_, served_, q);
  if (now_.mirrors)
    for (const int side : {0, 1}) copy_arm(side, followed_, 1.0, q);
  if (now_.preset) act_preset(seconds, q);
  const bool in_kiss = now_.all_gestures && round >= kRound.kiss && round < kRound.wave;
  const bool kisses = (now_.gesture == ControlGesture::kKiss && awake_) || in_kiss;
  const bool waves =
      (now_.gesture == ControlGesture::kWave && awake_ && !now_.preset) || (now_.all_gestures && round >= kRound.wave);
  if (kisses) {
    const double t = now_.all_gestures ? round - kRound.kiss : gesture_time(seconds);
    const double up = smooth(t / 0.5) * (now_.all_gestures ? 1.0 : 1.0 - smooth((t - 2.4) / 0.6));
    Eigen::VectorXd hand = robot_->neutral;
    copy_arm(1, poses_.mouth, 1.0, hand);
    copy_arm(1, poses_.blown, smooth((t - 0.8) / 0.4), hand);
    copy_arm(1, hand, up, q);
  }
  if (waves) {
    const double swing = std::abs(4.0 * std::fmod(kWaveRate * (seconds - begun_), 1.0) - 2.0) / 2.0;  // 0 to 1 and back
    copy_arm(1, poses_.wave_out, 1.0, q);
    copy_arm(1, poses_.wave_in, swing, q);
  }
  for (const int joint : tilting_waist(*robot_)) {
    const double pitch = hinge_axis(*robot_, joint).y();
    if (std::abs(pitch) > 0.7) q[joint] += std::copysign(kWaist * bow(seconds), pitch);
  }
  for (int j = 0; j < robot_->dof(); ++j) q[j] = std::clamp(q[j], robot_->joints[j].lower, robot_->joints[j].upper);
  return q;
}

void ControlPolicy::act_preset(double seconds, Eigen::VectorXd& q) const {
  const double t = gesture_time(seconds), up = smooth(t / kPresetUp);
  const double held = up * (1.0 - smooth((t - kPresetHeld) / kPresetUp));
  const auto swing = [&](double rate) { return 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * rate * t); };  // 0 to 1
  Eigen::VectorXd arms = robot_->neutral;
  switch (now_.gesture) {
    case ControlGesture::kShake:
      copy_arm(1, poses_.offered, 1.0, arms);
      copy_arm(1, poses_.shaken, swing(kShakeRate), arms);
      return copy_arm(1, arms, held, q);
    case ControlGesture::kHighFive:
      return copy_arm(1, poses_.raised, held, q);
    case ControlGesture::kHug:
      for (const int side : {0, 1}) {
        copy_arm(side, poses_.open[side], 1.0, arms);
        copy_arm(side, poses_.closed[side], smooth((t - 2.0 * kPresetUp) / kPresetUp), arms);
        copy_arm(side, arms, held, q);
      }
      return;
    case ControlGesture::kWave:
      copy_arm(1, poses_.wave_out, 1.0, arms);
      copy_arm(1, poses_.wave_in, swing(kWaveRate), arms);
      return copy_arm(1, arms, up * (1.0 - smooth((t - kPresetWave) / kPresetUp)), q);
    case ControlGesture::kNone:
    case ControlGesture::kBow:
    case ControlGesture::kKiss:  // as every control's, once
      return;
  }
}

Reference ControlPolicy::reference(const Place& place, double seconds, double ahead) const {
  Reference reference{start_.X_WB, pose(seconds)};
  double yaw = yaw_of(start_.X_WB.R);
  if (now_.distance > 0.0) {
    const bool near = now_.all_gestures && std::fmod(seconds, kRound.end) >= kRound.near;
    const double goal = awake_ || now_.apart == 0.0 ? now_.distance : now_.apart;
    const double left = place.distance - (goal - (near ? now_.lean_in : 0.0));
    const double advance = std::clamp(left, -kRetreat * ahead, kAdvance * ahead);
    yaw = place.yaw + std::clamp(wrapped(place.face - place.yaw), -kTurn * ahead, kTurn * ahead);
    reference.X_WB.p.head<2>() = place.root.head<2>() + advance * place.towards;
  }
  const Eigen::AngleAxisd pitch(kPitch * bow(seconds), Eigen::Vector3d::UnitY());
  reference.X_WB.R = yaw_rotation(yaw) * Eigen::Quaterniond(pitch);
  return reference;
}

void ControlPolicy::copy_arm(int side, const Eigen::VectorXd& from, double share, Eigen::VectorXd& q) const {
  for (const int joint : robot_->roles.arms[side]) q[joint] += share * (from[joint] - q[joint]);
}

}  // namespace duet
