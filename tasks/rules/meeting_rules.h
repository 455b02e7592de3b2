// The verdict of a rule that is met by one meeting of hands: the meeting that meets every condition, else the one that
// meets most. Thread-safe.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/evidence.h"

namespace duet::rules {

// A condition by the name of its threshold: by how much it holds, from 0 on it does.
struct MeetingCondition {
  std::string_view threshold;
  double slack = 0.0;
};
using MeetingConditions = std::vector<MeetingCondition> (*)(const HandMeeting& meeting, const Thresholds& tau);

// Parts and margins by threshold; evidence: the frames of the judged meeting. Values: distance_min of all pairs of
// hands, and of the judged meeting (0 without one) together_s, shake, travel, height_own, height_other, trunks,
// closing, parted. `agents` are smoothed.
DetectorResult judge_meetings(const Agent& performer, const Agent& partner, const Nearness& near, const Thresholds& tau,
                              MeetingConditions conditions);

// The figures that judge_meetings gives.
inline constexpr auto kMeetingFigures = std::to_array<DetectorFigure>({
    {"distance_min", "m", "least distance of the nearest hands"},
    {"together_s", "s", "how long the hands of the judged meeting stay together; 0: there is none"},
    {"shake", "m", "range of heights that both of them go through"},
    {"travel", "m", "range of heights of the one that moves more"},
    {"height_own", "m", "mean height of the performer's hand over its shoulders meanwhile"},
    {"height_other", "m", "mean height of the partner's hand over its shoulders meanwhile"},
    {"trunks", "m", "horizontal distance of the trunks meanwhile"},
    {"closing", "m/s", "speed at which the hands came together"},
    {"parted", "m", "largest distance of the two afterwards"},
});

}  // namespace duet::rules
