// Whether an episode of a task was the interaction: the robot did the act, with the partner, in reply to him, and no
// other act, and stood to the end (docs/detectors.md, "The rule interaction"). Each condition is a part of the verdict,
// so that a failed episode says why. Pure functions.
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/metrics/contact_safety.h"
#include "duet/metrics/detector.h"
#include "duet/robots/human_body.h"
#include "duet/robots/robot_model.h"

namespace duet {

// How a solid partner was touched while the act was due. Times are of all touches together, gaps left out.
struct PartnerTouch {
  double hands_s = 0.0;                 // a hand of the robot at a hand of the partner [s]
  double trunk_s = 0.0;                 // an arm of the robot at the partner's trunk [s]
  std::optional<double> settled_ratio;  // see ContactSafetyResult
};

// Frames of the recording in which the act is due: somewhat more than its phases.
struct ActWindow {
  int begin = 0, end = 0;  // [begin, end)
};
ActWindow act_window(const Phases& phases, double rate_hz);

PartnerTouch partner_touch(const ContactSafetyResult& safety, const RobotModel& robot, const HumanBody& human,
                           const ActWindow& window, double rate_hz);

// Whether the partner of a clip begins the act, so that it can be answered. True for every task that takes two: nobody
// shakes the hand of a person who does not.
bool partner_begins(Task task, const PointTracks& partner);

// The evidence of one episode that the rule looks at, at 50 Hz.
struct InteractionEvidence {
  Agent performer, partner;                // of the whole episode
  std::optional<PartnerTouch> touch = {};  // none: the partner is a ghost
  ActWindow window = {};
  // The person in the performer's place when the clip was made, over the act: nobody has to wait longer than he did.
  std::optional<Agent> model = {};
  int model_begin = 0;  // frame of the episode at which `model` begins
  bool stands = true;   // to the end
};

// When the act begins: the first time that a hand is raised by a fifth of an arm over the lowest place that it had so
// far and stays up for 0.3 s, be it withdrawn afterwards; of a bow, that the trunk leans by 10 degrees. [frames]
std::optional<int> act_onset(ActOnset onset, const Agent& agent);

// Parts: act, alone, touch, force, reply, stands and, of a ghost, body. Values: touch_s, hands_min [m], settled_ratio,
// lead_s (by which it begins before its partner), also_<task> (1 where the act of that task was seen, too) and, of a
// ghost, trunks_apart (least level distance of trunks and roots, of their mean breadth) [1]. Throws as detect_by_rule;
// `cannot_judge` says why.
DetectorResult judge_interaction(Task task, const InteractionEvidence& evidence);

// Why the rule cannot judge: a task without a rule, a partner who is absent, a robot without hands; empty: it can.
std::string cannot_judge(Task task, const InteractionEvidence& evidence);

// When a body begins its act: the moment its hands leave where they are carried while it prepares. Compares how soon a
// robot answers a partner who starts earlier or later. Pure functions.

inline constexpr double kOnsetDistance = 0.12;  // [m]
inline constexpr double kOnsetRest = 1.0;       // the first second says where the hands are carried [s]
inline constexpr double kOnsetWindow = 0.2;     // [s]
// An arm that swings with the steps leaves its place for less. [s]
inline constexpr double kOnsetStay = 0.6;

// `hands`: each (3, T) [m] in a frame that goes with the body, T alike. The first time from kOnsetRest on at which a
// hand's distance from its median place (per axis) over the first kOnsetRest, as a mean over the kOnsetWindow from then
// on, exceeds kOnsetDistance and goes on to for kOnsetStay. NaN where none does or the motion is too short to tell. [s]
double onset(const std::vector<Eigen::Matrix3Xd>& hands, double rate_hz);

// "onset_s": of the robot as executed, keypoints lhand and rhand in the pelvis frame; "partner_onset_s": of the
// partner's wrists in the frame of its root, which turns with the hips about z. NaN where never, or without a partner.
std::map<std::string, double> onsets(const Recording& recording, const RobotModel& robot);

}  // namespace duet
