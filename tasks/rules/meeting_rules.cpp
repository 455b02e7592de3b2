#include "duet/tasks/rules/meeting_rules.h"

#include <algorithm>
#include <limits>
#include <string>

#include "duet/tasks/rules/agent.h"

namespace duet::rules {
namespace {

int held(const std::vector<MeetingCondition>& conditions) {
  return static_cast<int>(
      std::count_if(conditions.begin(), conditions.end(), [](const MeetingCondition& c) { return c.slack >= 0.0; }));
}

// The meeting that holds the most conditions; among equally good ones the longest, then the first.
const HandMeeting* judged_meeting(const std::vector<HandMeeting>& meetings, const Thresholds& tau,
                                  MeetingConditions conditions) {
  const HandMeeting* best = nullptr;
  int most = -1;
  for (const HandMeeting& meeting : meetings) {
    const int count = held(conditions(meeting, tau));
    if (count < most || (count == most && meeting.span.frames() <= best->span.frames())) continue;
    best = &meeting;
    most = count;
  }
  return best;
}

}  // namespace

DetectorResult judge_meetings(const Agent& performer, const Agent& partner, const Nearness& near, const Thresholds& tau,
                              MeetingConditions conditions) {
  const std::vector<HandMeeting> meetings = hand_meetings(performer, partner, near);
  const HandMeeting* found = judged_meeting(meetings, tau, conditions);
  const HandMeeting meeting = found != nullptr ? *found : HandMeeting{};
  const Eigen::ArrayXd nearest = closest_hands(performer, partner).distance;

  DetectorResult result;
  result.frames = mask_of(meeting.span, nearest.size());
  result.success = found != nullptr;
  for (const MeetingCondition& condition : conditions(meeting, tau)) {
    const std::string name(condition.threshold);
    const bool holds = found != nullptr && condition.slack >= 0.0;
    result.parts[name] = holds;
    result.margins[name] = found != nullptr ? condition.slack : -std::numeric_limits<double>::infinity();
    result.success = result.success && holds;
  }
  result.values = {{"distance_min", nearest.minCoeff()},
                   {"together_s", meeting.span.seconds()},
                   {"shake", meeting.shake},
                   {"travel", meeting.travel},
                   {"height_own", meeting.own_height},
                   {"height_other", meeting.other_height},
                   {"trunks", meeting.trunks},
                   {"closing", meeting.closing},
                   {"parted", meeting.parted}};
  return result;
}

// Fist bump: two hands meet below the shoulders, quickly and for a moment, and part again, while both stand at arm's
// length. A clasp lasts longer and is shaken, a high-five is up; an object that is handed over is met slowly.

namespace {

std::vector<MeetingCondition> fist_bump_conditions(const HandMeeting& m, const Thresholds& tau) {
  return {{"shortest", m.span.seconds() - tau.at("shortest")},
          {"longest", tau.at("longest") - m.span.seconds()},
          {"height", tau.at("height") - 0.5 * (m.own_height + m.other_height)},
          {"still", tau.at("still") - m.shake},
          {"one_side", m.performer_right == m.partner_right ? 0.0 : -tau.at("one_side")},
          {"apart", m.trunks - tau.at("apart")},
          {"closing", m.closing - tau.at("closing")},
          {"part", m.parted - tau.at("part")}};
}

DetectorResult detect_fist_bump_act(const Agent& performer, const Agent& partner, const Thresholds& tau) {
  const double contact = tau.at("contact");
  return judge_meetings(performer, partner, {contact, 0.0, contact}, tau, fist_bump_conditions);
}

constexpr auto kFistBumpRule = std::to_array<RuleThreshold>({
    {"contact", 0.15, "m", "two hands are together while nearer"},
    {"shortest", 0.1, "s", "they stay together at least so long"},
    {"longest", 1.4, "s", "they stay together at most so long"},
    {"height", -0.05, "m", "their mean height over the shoulders is at most this"},
    {"still", 0.035, "m", "not both of them go up and down by more meanwhile"},
    {"one_side", 1, "1", "1: both are left or both are right hands; 0: any"},
    {"apart", 0.5, "m", "the trunks are at least so far apart meanwhile"},
    {"closing", 0.5, "m/s", "they come together at this speed or faster"},
    {"part", 0.3, "m", "afterwards they come at least so far apart"},
});

}  // namespace

const ActRule kFistBump = {
    .thresholds = kFistBumpRule, .figures = kMeetingFigures, .tracks = meeting_tracks, .detect = detect_fist_bump_act};

// Handshake: two hands stay together below the shoulders while both stand at arm's length, and go up and down together
// or hold on. People shake hands of one side. An object that is handed over goes from any hand to any, leaves the giver
// within a second and does not go up and down; a fist bump is over at once; a high-five is up; rocket and parachute
// travel and turn once.

namespace {

std::vector<MeetingCondition> handshake_conditions(const HandMeeting& m, const Thresholds& tau) {
  const double turns = m.turns - tau.at("turns"), held = m.span.seconds() - tau.at("hold");
  const bool same_side = m.performer_right == m.partner_right;
  return {{"clasp", m.span.seconds() - tau.at("clasp")},
          {"crossed", same_side ? m.span.seconds() : m.span.seconds() - tau.at("crossed")},
          {"turns", std::max(turns, held)},
          {"hold", std::max(turns, held)},
          {"travel", turns >= 0.0 ? m.travel : tau.at("travel") - m.travel},
          {"height", tau.at("height") - 0.5 * (m.own_height + m.other_height)},
          {"apart", m.trunks - tau.at("apart")}};
}

DetectorResult detect_handshake_act(const Agent& performer, const Agent& partner, const Thresholds& tau) {
  return judge_meetings(performer, partner, {tau.at("contact"), tau.at("steady"), tau.at("farthest")}, tau,
                        handshake_conditions);
}

constexpr auto kHandshakeRule = std::to_array<RuleThreshold>({
    {"contact", 0.2, "m", "two hands are together while nearer,"},
    {"steady", 0.06, "m", "or, never so near, while within this of their least distance,"},
    {"farthest", 0.3, "m", "which is below this"},
    {"clasp", 0.6, "s", "they stay together at least so long"},
    {"crossed", 1.1, "s", "a left with a right hand at least so long"},
    {"turns", 3, "1", "both turn up or down by 1.5 cm so often meanwhile, or"},
    {"hold", 1.2, "s", "they stay together at least so long"},
    {"travel", 0.35, "m", "unless they turn so often, neither goes up or down by more meanwhile"},
    {"height", 0.0, "m", "their mean height over the shoulders is at most this"},
    {"apart", 0.5, "m", "the trunks are at least so far apart meanwhile"},
});

}  // namespace

const ActRule kHandshake = {
    .thresholds = kHandshakeRule, .figures = kMeetingFigures, .tracks = meeting_tracks, .detect = detect_handshake_act};

// High-five: the performer's hand is up at its shoulder or higher and meets the partner's for a moment, while both
// stand at arm's length. A clasp lasts longer and is lower.

namespace {

std::vector<MeetingCondition> high_five_conditions(const HandMeeting& m, const Thresholds& tau) {
  return {{"longest", tau.at("longest") - m.span.seconds()},
          {"height", m.own_height - tau.at("height")},
          {"height_other", m.other_height - tau.at("height_other")},
          {"apart", m.trunks - tau.at("apart")}};
}

// Heights are shares of each one's own arm.
DetectorResult detect_high_five_act(const Agent& performer, const Agent& partner, const Thresholds& tau) {
  const double contact = tau.at("contact");
  Thresholds metres = tau;
  metres.at("height") *= performer.arm;
  metres.at("height_other") *= partner.arm;
  return judge_meetings(performer, partner, {contact, 0.0, contact}, metres, high_five_conditions);
}

constexpr auto kHighFiveRule = std::to_array<RuleThreshold>({
    {"contact", 0.2, "m", "two hands are together while nearer"},
    {"longest", 1.0, "s", "they stay together at most so long"},
    {"height", -0.28, "arm", "the performer's is at least so high over its shoulders meanwhile"},
    {"height_other", -0.35, "arm", "the partner's is at least so high over its shoulders meanwhile"},
    {"apart", 0.5, "m", "the trunks are at least so far apart meanwhile"},
});

}  // namespace

const ActRule kHighFive = {
    .thresholds = kHighFiveRule, .figures = kMeetingFigures, .tracks = meeting_tracks, .detect = detect_high_five_act};

}  // namespace duet::rules
