// High-five: the performer's hand is up at its shoulder or higher and meets the partner's for a moment, while both
// stand at arm's length. A clasp lasts longer and is lower.
#include "duet/tasks/rules/act_rule.h"
#include "duet/tasks/rules/judge_meetings.h"

namespace duet::rules {
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
