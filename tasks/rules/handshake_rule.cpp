// Handshake: two hands stay together below the shoulders while both stand at arm's length, and go up and down together
// or hold on. People shake hands of one side. An object that is handed over goes from any hand to any, leaves the giver
// within a second and does not go up and down; a fist bump is over at once; a high-five is up; rocket and parachute
// travel and turn once.
#include <algorithm>

#include "duet/tasks/rules/act_rule.h"
#include "duet/tasks/rules/judge_meetings.h"

namespace duet::rules {
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

}  // namespace duet::rules
