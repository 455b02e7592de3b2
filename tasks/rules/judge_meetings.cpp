#include "duet/tasks/rules/judge_meetings.h"

#include <algorithm>
#include <limits>
#include <string>

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

}  // namespace duet::rules
