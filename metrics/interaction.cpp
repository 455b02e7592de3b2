#include "duet/metrics/interaction.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/robots/kinematics.h"
#include "duet/tasks/rules/evidence.h"

namespace duet {
namespace {

using rules::FrameSpan;
using rules::kRateHz;

// The act is due from half a second before its phases to a second after them.
constexpr double kEarlier = 0.5, kLater = 1.0;  // [s]

// A hand that is raised by a fifth of an arm is on its way: 12 cm of a person. [1]
constexpr double kRaised = 0.2;
constexpr double kLeans = 10.0 * std::numbers::pi / 180.0;
constexpr double kStays = 0.3;  // [s]
// The lead over the other that 95 % of those who shake hands in SBU and K3HI stay within (5 % quantiles of both roles:
// 0.46 and 0.28 s). [s]
constexpr double kLead = 0.5;
// Nobody has to wait longer than the person did in whose place the robot is, give or take this. [s]
constexpr double kModelLead = 0.3;

// The trunks of two people who hug stay so far apart, of their mean breadth: in SBU's 41 hugs at least 0.447. [1]
constexpr double kApart = 0.44;

bool is_trunk(const std::string& region) {
  return region == "chest" || region == "abdomen" || region == "back" || region == "pelvis";
}

bool hangs_on(const RobotModel& robot, int link, const std::vector<int>& arm) {
  for (; link > 0; link = robot.links[link].parent)
    if (std::ranges::find(arm, link - 1) != arm.end()) return true;
  return false;
}

struct Interval {
  double begin, end;
};

double union_of(std::vector<Interval> intervals) {
  std::ranges::sort(intervals, {}, &Interval::begin);
  double total = 0.0, reached = -std::numeric_limits<double>::infinity();
  for (const Interval& interval : intervals) {
    const double begin = std::max(interval.begin, reached);
    if (interval.end > begin) total += interval.end - begin;
    reached = std::max(reached, interval.end);
  }
  return total;
}

// The first frame from which the mask holds for so long.
std::optional<int> first_kept(const FrameMask& mask, double seconds) {
  const int stay = static_cast<int>(std::lround(seconds * kRateHz));
  for (const FrameSpan& span : rules::spans_of(mask))
    if (span.frames() >= stay) return span.begin;
  return std::nullopt;
}

// Height over the lowest place so far.
Eigen::ArrayXd raised(const Eigen::Matrix3Xd& hand, const Agent& agent) {
  Eigen::ArrayXd height = heights(hand, agent.root);
  double lowest = std::numeric_limits<double>::infinity();
  for (Eigen::Index t = 0; t < height.size(); ++t) {
    lowest = std::min(lowest, height[t]);
    height[t] -= lowest;
  }
  return height;
}

Eigen::ArrayXd inclination(const Agent& agent) {
  Eigen::ArrayXd angle(agent.head.cols());
  for (Eigen::Index t = 0; t < angle.size(); ++t) {
    const Eigen::Vector3d trunk = agent.head.col(t) - agent.root.col(t);
    angle[t] = std::atan2(trunk.head<2>().norm(), trunk.z());
  }
  return angle;
}

bool overlaps(const std::vector<bool>& frames, const ActWindow& window) {
  for (int t = std::max(window.begin, 0); t < std::min(window.end, static_cast<int>(frames.size())); ++t)
    if (frames[static_cast<std::size_t>(t)]) return true;
  return false;
}

bool is_included(const InteractionRule& rule, Task other) {
  return std::ranges::find(rule.includes, to_string(other)) != rule.includes.end();
}

// As act_onset, of smoothed tracks and for so long. [frames]
std::optional<int> onset_of(ActOnset onset, const Agent& agent, double seconds) {
  if (onset == ActOnset::kNone) return std::nullopt;
  if (onset == ActOnset::kTrunkLeans) return first_kept(at_least(inclination(agent), kLeans), seconds);
  std::optional<int> first;
  for (const Eigen::Matrix3Xd* hand : {&agent.lhand, &agent.rhand})
    if (const std::optional<int> found = first_kept(at_least(raised(*hand, agent), kRaised * agent.arm), seconds))
      first = first ? std::min(*first, *found) : *found;
  return first;
}

// By how much the performer begins before it may. [s] Nothing to wait for: minus infinity.
struct Lead {
  double before_partner = std::numeric_limits<double>::quiet_NaN();
  double over = -std::numeric_limits<double>::infinity();
};

// A performer that does the act has begun it: where nothing stays up for kStays, with the first that comes up at all.
Lead lead_of(ActOnset onset, const InteractionEvidence& e, const SmoothedAgents& agents, bool acts) {
  std::optional<int> own = onset_of(onset, agents.performer, kStays);
  if (!own && acts) own = onset_of(onset, agents.performer, 0.0);
  const std::optional<int> partner = onset_of(onset, agents.partner, kStays);
  if (!own || !partner) return {};
  Lead lead{.before_partner = (*partner - *own) / kRateHz};
  double earliest = *partner - kLead * kRateHz;
  if (e.model)
    if (const std::optional<int> model = act_onset(onset, *e.model))
      earliest = std::min(earliest, e.model_begin + *model - kModelLead * kRateHz);
  lead.over = (earliest - *own) / kRateHz;
  return lead;
}

// From shoulder to shoulder. [m]
double breadth(const Agent& agent) { return (agent.lshoulder - agent.rshoulder).colwise().norm().mean(); }

double least_level_distance(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) {
  return (a - b).topRows<2>().colwise().norm().minCoeff();
}

// Least level distance of the two, at the trunk or the root, of their mean breadth. [1]
double trunks_apart(const SmoothedAgents& agents) {
  const double least = std::min(least_level_distance(agents.performer.torso, agents.partner.torso),
                                least_level_distance(agents.performer.root, agents.partner.root));
  return least / (0.5 * (breadth(agents.performer) + breadth(agents.partner)));
}

// The touch that the task asks for.
struct Touched {
  double seconds = std::numeric_limits<double>::quiet_NaN();  // of a solid partner
  double margin = std::numeric_limits<double>::infinity();
};

Touched touched(const InteractionRule& rule, const InteractionEvidence& e, double hands_min) {
  if (rule.touch == Touch::kNone) return {};
  if (!e.touch)
    return {.margin = rule.ghost_hands > 0.0 ? rule.ghost_hands - hands_min : std::numeric_limits<double>::infinity()};
  const double seconds = rule.touch == Touch::kHands ? e.touch->hands_s : e.touch->trunk_s;
  return {seconds, seconds - rule.touch_s};
}

double hands_min(const InteractionEvidence& e) {
  const int begin = std::max(e.window.begin, 0);
  const int end = std::min(e.window.end, static_cast<int>(e.performer.lhand.cols()));
  if (end <= begin) return std::numeric_limits<double>::quiet_NaN();
  return closest_hands(e.performer, e.partner).distance.segment(begin, end - begin).minCoeff();
}

// Physics keeps a robot out of a solid partner; a ghost is not walked through either.
void add_body(const SmoothedAgents& agents, DetectorResult& result) {
  const double apart = trunks_apart(agents);
  result.values["trunks_apart"] = apart;
  result.parts["body"] = apart >= kApart;
  result.margins["body"] = apart - kApart;
}

}  // namespace

ActWindow act_window(const Phases& phases, double rate_hz) {
  return {phases.act_begin - static_cast<int>(std::lround(kEarlier * rate_hz)),
          phases.act_end + static_cast<int>(std::lround(kLater * rate_hz))};
}

PartnerTouch partner_touch(const ContactSafetyResult& safety, const RobotModel& robot, const HumanBody& human,
                           const ActWindow& window, double rate_hz) {
  const int hands[] = {robot.frames[robot.track_frame("lhand")].link, robot.frames[robot.track_frame("rhand")].link};
  std::vector<Interval> at_hands, at_trunk;
  for (const ContactEvent& event : safety.events) {
    const Interval interval{std::max(event.begin_s, window.begin / rate_hz),
                            std::min(event.begin_s + event.duration_s, window.end / rate_hz)};
    if (interval.end <= interval.begin) continue;
    const std::string& region = human.capsules[static_cast<std::size_t>(event.capsule)].region;
    if (region == "hand" && (event.link == hands[0] || event.link == hands[1])) at_hands.push_back(interval);
    const bool arm =
        hangs_on(robot, event.link, robot.roles.arms[0]) || hangs_on(robot, event.link, robot.roles.arms[1]);
    if (is_trunk(region) && arm) at_trunk.push_back(interval);
  }
  return {union_of(std::move(at_hands)), union_of(std::move(at_trunk)), safety.settled_ratio};
}

std::optional<int> act_onset(ActOnset onset, const Agent& raw) { return onset_of(onset, rules::smoothed(raw), kStays); }

bool partner_begins(Task task, const PointTracks& partner) {
  const InteractionRule& rule = definition_of(task).interaction;
  if (rule.touch != Touch::kNone || rule.onset == ActOnset::kNone) return true;
  return act_onset(rule.onset, human_agent(partner)).has_value();
}

std::string cannot_judge(Task task, const InteractionEvidence& evidence) {
  const TaskDefinition& definition = definition_of(task);
  if (definition.rule == nullptr) return fmt::format("the task {} has no rule of its own", to_string(task));
  if (evidence.partner.root.cols() == 0) return "no partner was recorded";
  if (evidence.performer.lhand.cols() == 0) return "the robot has no hands";
  return "";
}

DetectorResult judge_interaction(Task task, const InteractionEvidence& e) {
  const std::string why_not = cannot_judge(task, e);
  require(why_not.empty(), "cannot be judged under `interaction`: {}", why_not);
  const InteractionRule& rule = definition_of(task).interaction;
  const SmoothedAgents agents = smoothed_for_rules(e.performer, e.partner);
  const DetectorResult act = detect_by_rule(task, agents);
  const double nearest = hands_min(e);
  const Touched touch = touched(rule, e, nearest);
  const Lead lead = lead_of(rule.onset, e, agents, act.success);

  DetectorResult result;
  result.frames = act.frames;
  result.values = {{"touch_s", touch.seconds}, {"hands_min", nearest}, {"lead_s", lead.before_partner}};
  int others = 0;
  for (const Task other : all_tasks()) {
    if (other == task || definition_of(other).rule == nullptr || is_included(rule, other)) continue;
    if (!detect_by_rule(other, agents).success) continue;
    result.values[fmt::format("also_{}", to_string(other))] = 1.0;
    ++others;
  }
  const double settled = e.touch && e.touch->settled_ratio ? *e.touch->settled_ratio : 0.0;
  if (e.touch) result.values["settled_ratio"] = settled;
  result.parts = {{"act", act.success && overlaps(act.frames, e.window)},
                  {"alone", others == 0},
                  {"touch", touch.margin >= 0.0},
                  {"force", settled <= 1.0},
                  {"reply", lead.over <= 0.0},
                  {"stands", e.stands}};
  result.margins = {{"touch", touch.margin}, {"force", 1.0 - settled}, {"reply", -lead.over}};
  if (!e.touch) add_body(agents, result);
  for (const auto& [name, margin] : act.margins) result.margins["act." + name] = margin;
  result.success = std::all_of(result.parts.begin(), result.parts.end(), [](const auto& part) { return part.second; });
  return result;
}

namespace {

Eigen::Vector3d median_place(const Eigen::Matrix3Xd& track, Eigen::Index frames) {
  Eigen::Vector3d median;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::VectorXd values = track.row(axis).head(frames);
    std::nth_element(values.begin(), values.begin() + frames / 2, values.end());
    median[axis] = values[frames / 2];
  }
  return median;
}

// First of `stay` frames in a row, from `begin` on, whose mean over `window` frames exceeds the threshold; -1 where
// there are none.
Eigen::Index first_above(const Eigen::VectorXd& distance, Eigen::Index begin, Eigen::Index window, Eigen::Index stay) {
  Eigen::Index run = 0;
  for (Eigen::Index t = begin; t + window <= distance.size(); ++t) {
    run = distance.segment(t, window).mean() > kOnsetDistance ? run + 1 : 0;
    if (run == stay) return t + 1 - stay;
  }
  return -1;
}

std::vector<Eigen::Matrix3Xd> hands_of_robot(const Recording& recording, const RobotModel& robot) {
  const int frames[] = {robot.track_frame("lhand"), robot.track_frame("rhand")};
  std::vector<Eigen::Matrix3Xd> hands(2, Eigen::Matrix3Xd(3, recording.frames()));
  Kinematics kinematics(robot);
  for (int t = 0; t < recording.frames(); ++t) {
    const RobotState& state = recording.robot[static_cast<std::size_t>(t)];
    kinematics.update(state.X_WB, state.q);
    for (std::size_t hand = 0; hand < hands.size(); ++hand)
      hands[hand].col(t) = state.X_WB.inverse() * kinematics.frame_position(frames[hand]);
  }
  return hands;
}

std::vector<Eigen::Matrix3Xd> wrists_of(const PointTracks& partner) {
  const int wrists[] = {kLeftWrist, kRightWrist};
  std::vector<Eigen::Matrix3Xd> hands(2, Eigen::Matrix3Xd(3, partner.frames()));
  for (int t = 0; t < partner.frames(); ++t) {
    const Eigen::Vector3d left = partner.at(t, kLeftHip) - partner.at(t, kRightHip);
    const Eigen::Quaterniond R_RW = yaw_rotation(std::atan2(-left.x(), left.y())).conjugate();
    for (std::size_t hand = 0; hand < hands.size(); ++hand)
      hands[hand].col(t) = R_RW * (partner.at(t, wrists[hand]) - partner.at(t, kPelvis));
  }
  return hands;
}

}  // namespace

double onset(const std::vector<Eigen::Matrix3Xd>& hands, double rate_hz) {
  const auto rest = static_cast<Eigen::Index>(std::lround(kOnsetRest * rate_hz));
  const auto window = static_cast<Eigen::Index>(std::lround(kOnsetWindow * rate_hz));
  const auto stay = static_cast<Eigen::Index>(std::lround(kOnsetStay * rate_hz));
  Eigen::Index first = -1;
  for (const Eigen::Matrix3Xd& hand : hands) {
    if (hand.cols() < rest + window) continue;
    const Eigen::Vector3d place = median_place(hand, rest);
    const Eigen::VectorXd distance = (hand.colwise() - place).colwise().norm().transpose();
    const Eigen::Index found = first_above(distance, rest, window, stay);
    if (found >= 0) first = first < 0 ? found : std::min(first, found);
  }
  return first < 0 ? std::numeric_limits<double>::quiet_NaN() : static_cast<double>(first) / rate_hz;
}

std::map<std::string, double> onsets(const Recording& recording, const RobotModel& robot) {
  std::map<std::string, double> values = {{"onset_s", onset(hands_of_robot(recording, robot), recording.rate_hz)}};
  if (!recording.partner.empty()) values["partner_onset_s"] = onset(wrists_of(recording.partner), recording.rate_hz);
  return values;
}

}  // namespace duet
