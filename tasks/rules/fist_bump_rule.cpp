// Fist bump: two hands meet below the shoulders, quickly and for a moment, and part again, while both stand at arm's
// length. A clasp lasts longer and is shaken, a high-five is up; an object that is handed over is met slowly.
#include "duet/tasks/rules/act_rule.h"
#include "duet/tasks/rules/judge_meetings.h"

namespace duet::rules {
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

}  // namespace duet::rules
