#include "duet/scoring/scoring.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "duet/archives/recording_file.h"
#include "duet/core/digest.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/experiment/suite/suite.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/diagnostics.h"
#include "duet/metrics/interaction.h"
#include "duet/metrics/locomotion.h"
#include "duet/metrics/retargeting.h"
#include "duet/motion/human_motion.h"
#include "duet/motion/npz_fields.h"
#include "duet/robots/human_body.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/roles.h"
#include "duet/rows/json_fields.h"
#include "duet/tasks/task_definition.h"

namespace duet {
namespace {

void add_strongest_contacts(const ContactSafetyResult& safety, const PairedMotion& clip, const RobotModel& robot,
                            EpisodeRow& row) {
  std::vector<ContactEvent> events = safety.events;
  const auto kept = static_cast<std::ptrdiff_t>(std::min(events.size(), kMostRowContacts));
  std::stable_sort(events.begin(), events.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.peak_n > b.peak_n; });
  events.erase(events.begin() + kept, events.end());
  std::sort(events.begin(), events.end(), [](const ContactEvent& a, const ContactEvent& b) {
    return std::tie(a.begin_s, a.link, a.capsule) < std::tie(b.begin_s, b.link, b.capsule);
  });
  const HumanBody human = make_human_body(bone_lengths(clip.partner));
  for (const ContactEvent& event : events)
    row.contacts.push_back({event, robot.links.at(event.link).name, safety.regions.at(event.region).region,
                            human.capsules.at(event.capsule).name});
  row.contacts_total = static_cast<long>(safety.events.size()) + static_cast<long>(safety.events_left_out);
}

void set_outcome(const Recording& recording, EpisodeRow& row) {
  row.outcome = recording.outcome;
  row.message = recording.message;
  row.fell = recording.outcome == Outcome::kFell;
  row.frames = recording.frames();
  row.sim_s = recording.frames() / recording.rate_hz;
}

void set_measured(const Rollout& rollout, EpisodeRow& row) {
  row.faults = rollout.faults;
  row.state_hash = rollout.state_hash;
  row.forces = {{"ground.mean_n", rollout.ground.mean}, {"ground.peak_n", rollout.ground.peak}};
}

// Names in `row.forces` of what the rule `interaction` asks of a solid partner's contacts.
constexpr const char* kHandsTouch = "human.hands_touch_s";
constexpr const char* kTrunkTouch = "human.trunk_touch_s";
constexpr const char* kSettledRatio = "human.settled_ratio";

std::optional<PartnerTouch> touch_of(const EpisodeRow& row) {
  const auto hands = row.forces.find(kHandsTouch), trunk = row.forces.find(kTrunkTouch);
  if (hands == row.forces.end() || trunk == row.forces.end()) return std::nullopt;
  PartnerTouch touch{hands->second, trunk->second, std::nullopt};
  if (const auto ratio = row.forces.find(kSettledRatio); ratio != row.forces.end()) touch.settled_ratio = ratio->second;
  return touch;
}

void add_contacts(const Rollout& rollout, const PairedMotion& clip, const RobotModel& robot, EpisodeRow& row) {
  if (!rollout.safety) return;
  const PartnerTouch touch =
      partner_touch(*rollout.safety, robot, make_human_body(bone_lengths(clip.partner)),
                    act_window(rollout.recording.phases, rollout.recording.rate_hz), rollout.recording.rate_hz);
  row.forces[kHandsTouch] = touch.hands_s;
  row.forces[kTrunkTouch] = touch.trunk_s;
  row.contact_peak_n = rollout.safety->peak_force;
  row.contact_impulse_ns = rollout.safety->impulse;
  add_finite(contact_forces(*rollout.safety), row.forces);
  add_finite(contact_safety_metrics(*rollout.safety), row.metrics);
  add_strongest_contacts(*rollout.safety, clip, robot, row);
}

// [mm]
void append_point(const Eigen::Vector3d& p_W, std::vector<int>& to) {
  for (const double value : p_W) to.push_back(static_cast<int>(std::lround(1000.0 * value)));
}

int sole_height_mm(const Kinematics& kinematics, const std::vector<int>& shapes) {
  double lowest = std::numeric_limits<double>::infinity();
  for (const int i : shapes) {
    const RobotShape& shape = kinematics.model().shapes[i];
    const Eigen::Vector3d axis_W = kinematics.R_WL(shape.link) * (shape.X_LS.R * Eigen::Vector3d::UnitZ());
    const double reach = shape.radius + shape.half_length * std::abs(axis_W.z());
    lowest = std::min(lowest, kinematics.shape_position(i).z() - reach);
  }
  return static_cast<int>(std::lround(1000.0 * lowest));
}

// An episode has one.
Task task_of(const Recording& recording) {
  require(recording.task.has_value(), "episode: expected a recording of a task, found one of none");
  return *recording.task;
}

// The verdict of the rule; where it cannot judge, a failure whose reason stands in the row's message.
Verdict interaction_verdict(const Recording& recording, const ScoringReference& source, const Agent& human,
                            const Agent& machine, EpisodeRow& row) {
  const Task task = task_of(recording);
  InteractionEvidence evidence{machine,
                               human,
                               touch_of(row),
                               act_window(recording.phases, recording.rate_hz),
                               std::nullopt,
                               recording.phases.act_begin,
                               recording.outcome == Outcome::kOk};
  if (source.reactor.frames() > 0) evidence.model = human_agent(source.reactor.joints);
  Verdict verdict;
  verdict.version = to_string(DetectorVersion::kInteraction);
  verdict.thresholds = to_string(ThresholdSet::kAct);
  std::string why_not = cannot_judge(task, evidence);
  if (why_not.empty() && row.engine == kPlaybackEngine && definition_of(task).interaction.touch != Touch::kNone)
    why_not = "playback has no physics, so that nothing touches";
  if (!why_not.empty()) {
    verdict.parts["judged"] = false;
    if (row.message.empty()) row.message = "cannot be judged under `interaction`: " + why_not;
    return verdict;
  }
  return to_verdict(judge_interaction(task, evidence), DetectorVersion::kInteraction, ThresholdSet::kAct);
}

}  // namespace

StateTrace state_trace(const Recording& recording, const RobotModel& robot) {
  StateTrace trace;
  trace.points = {"root"};
  std::vector<int> hands;  // of those that the card has: a walk needs none
  for (const auto& [track, name] : {std::pair{"lhand", "left_hand"}, {"rhand", "right_hand"}}) {
    if (!robot.tracks.contains(track)) continue;
    hands.push_back(robot.track_frame(track));
    trace.points.emplace_back(name);
  }
  const int stride = static_cast<int>(std::lround(recording.rate_hz / trace.rate_hz));
  Kinematics kinematics(robot);
  for (int t = 0; t < recording.frames(); t += stride) {
    const RobotState& state = recording.robot[t];
    kinematics.update(state.X_WB, state.q);
    std::vector<int>& frame = trace.mm.emplace_back();
    append_point(state.X_WB.p, frame);
    for (const int hand : hands) append_point(kinematics.frame_position(hand), frame);
  }
  return trace;
}

FootTrace foot_trace(const Recording& recording, const RobotModel& robot) {
  const std::vector<std::vector<int>> feet = soles_of_feet(robot);
  FootTrace trace;
  if (feet.size() != 2) return trace;
  const int stride = static_cast<int>(std::lround(recording.rate_hz / trace.rate_hz));
  Kinematics kinematics(robot);
  for (int t = 0; t < recording.frames(); t += stride) {
    kinematics.update(recording.robot[t].X_WB, recording.robot[t].q);
    trace.left_mm.push_back(sole_height_mm(kinematics, feet[0]));
    trace.right_mm.push_back(sole_height_mm(kinematics, feet[1]));
  }
  return trace;
}

NamedNumbers finite_of(const NamedNumbers& values) {
  std::map<std::string, double> finite;
  add_finite(values.map(), finite);
  return finite;
}

void add_finite(const std::map<std::string, double>& values, std::map<std::string, double>& out) {
  for (const auto& [name, value] : values)
    if (std::isfinite(value)) out[name] = value;
}

void add_finite(const std::map<std::string, double>& values, NamedNumbers& out) {
  std::map<std::string, double> all = out.map();
  add_finite(values, all);
  out = all;
}

Verdict to_verdict(const DetectorResult& result, DetectorVersion version, ThresholdSet set) {
  Verdict verdict{result, std::string(to_string(version)), std::string(to_string(set)),
                  static_cast<int>(std::ranges::count(result.frames, true))};
  for (NamedNumbers* numbers : {&verdict.values, &verdict.margins}) *numbers = finite_of(*numbers);
  return verdict;
}

ScoringReference act_source(const Recording& recording, const RolloutSetup& setup) {
  const int begin = setup.reference.clip_frame + std::min(recording.phases.act_begin, recording.frames());
  const int end = setup.reference.clip_frame + std::min(recording.phases.act_end, recording.frames());
  const PairedMotion& clip = *setup.clip;
  return {slice(clip.source_partner, begin, end), slice(clip.source_reactor, begin, end),
          clip.reshaped.empty() ? PointTracks() : clip.reshaped.slice(begin, end)};
}

std::string state_hash(const Recording& recording) {
  Sha256 hash;
  for (const RobotState& state : recording.robot) hash.update(state);
  return hash.hex();
}

std::vector<std::string> measured_metrics() {
  ContactSafetyResult result;
  result.worst_ratio = 0.0;
  std::vector<std::string> names;
  for (const auto& [name, value] : contact_safety_metrics(result)) names.push_back(name);
  return names;
}

void score_walk(const Rollout& rollout, const SuiteReference& reference, const RobotModel& robot, EpisodeRow& row) {
  const Recording& recording = rollout.recording;
  set_outcome(recording, row);
  set_measured(rollout, row);
  row.success = recording.outcome == Outcome::kOk;
  row.trace = state_trace(recording, robot);
  row.metrics = {{"command_forward", reference.velocity.x()},
                 {"command_sideways", reference.velocity.y()},
                 {"command_turn", reference.velocity.z()}};
  add_finite(locomotion_metrics(recording, robot), row.metrics);
  if (row.fell) row.metrics["time_to_fall"] = row.sim_s;
  if (recording.frames() >= kShortestScored) add_finite(controller_diagnostics(recording), row.metrics);
}

void score_recording(const Recording& recording, const ScoringReference& source, const ScoringRules& rules,
                     const RobotModel& robot, EpisodeRow& row) {
  const Task task = task_of(recording);
  const Agent human = human_agent(recording.partner);
  const Agent machine = robot_agent(robot, recording.robot);
  set_outcome(recording, row);
  row.trace = state_trace(recording, robot);
  if (rules.feet) row.feet = foot_trace(recording, robot);
  row.success = false;
  const bool by_rule = rules.detector == DetectorVersion::kInteraction;
  for (const DetectorVersion version : {DetectorVersion::kRobot, DetectorVersion::kPaper}) {
    for (const ThresholdSet set : kThresholdSets) {
      // Rows of suites that do not ask for it stay as they were before there was such a set.
      if (set == ThresholdSet::kAct && rules.thresholds != ThresholdSet::kAct && !by_rule) continue;
      const DetectorResult result = detect(task, human, machine, version, set, rules.readings.detectors);
      row.verdicts.push_back(to_verdict(result, version, set));
      if (version == rules.detector && set == rules.thresholds)
        row.success = result.success && recording.outcome == Outcome::kOk;
    }
  }
  if (by_rule) {
    row.verdicts.push_back(interaction_verdict(recording, source, human, machine, row));
    row.success = row.verdicts.back().success;
  }
  add_finite(onsets(recording, robot), row.metrics);
  if (recording.frames() < kShortestScored) return;
  add_finite(controller_diagnostics(recording, rules.readings.diagnostics), row.metrics);
  if (act_frames(recording) >= kShortestScored)
    add_finite(retargeting_metrics(recording, source, robot, rules.readings.metrics), row.metrics);
}

void score_rollout(const Rollout& rollout, const RolloutSetup& setup, const ScoringRules& rules,
                   const RobotModel& robot, EpisodeRow& row) {
  row.late_plans = rollout.late_plans;
  row.policy_faults = rollout.policy_faults;
  row.policy_ms = rollout.plan_times;
  set_measured(rollout, row);
  add_contacts(rollout, *setup.clip, robot, row);
  score_recording(rollout.recording, act_source(rollout.recording, setup), rules, robot, row);
}

namespace {

constexpr const char* kRow = "row";

template <typename E>
E parse_name(const Npz& npz, const std::string& key, const NameTable<E>& names) {
  const std::string found = npz.text(key);
  for (const auto& [name, value] : names)
    if (name == found) return value;
  throw InputError(fmt::format("'{}': key '{}': unknown name '{}'", npz.name(), key, excerpt(found)));
}

// Options that are not as by default.
std::map<std::string, std::string> chosen_readings(const Readings& readings) {
  std::map<std::string, std::string> chosen;
  for (const std::string& option : reading_names())
    if (reading(readings, option) != reading({}, option)) chosen[option] = reading(readings, option);
  return chosen;
}

void put_kept(Npz& npz, const KeptEpisode& kept) {
  npz.set_text(kRow, dumped(to_json(kept.row)));
  npz.set_text("detector_version", std::string(to_string(kept.rules.detector)));
  npz.set_text("detector_thresholds", std::string(to_string(kept.rules.thresholds)));
  npz.set_integer("feet", kept.rules.feet ? 1 : 0);
  put_texts(npz, "readings", chosen_readings(kept.rules.readings));
  npz.set("act_partner", kept.source.partner.joints);
  npz.set("act_reactor", kept.source.reactor.joints);
  if (!kept.source.reshaped.empty()) npz.set("act_reshaped", kept.source.reshaped);
}

EpisodeRow get_row(const Npz& npz) {
  try {
    return row_from_json(parse_json(npz.text(kRow), "expected a row"));
  } catch (const InputError& error) {
    throw InputError(fmt::format("'{}': key '{}': {}", npz.name(), kRow, error.what()));
  }
}

ScoringRules get_rules(const Npz& npz) {
  ScoringRules rules{parse_name(npz, "detector_version", version_names()),
                     parse_name(npz, "detector_thresholds", threshold_names()),
                     {},
                     npz.integer("feet") != 0};
  check_archive(npz, [&] {
    for (const auto& [option, value] : get_texts(npz, "readings")) set_reading(rules.readings, option, value);
  });
  return rules;
}

ScoringReference get_source(const Npz& npz, const Recording& recording) {
  ScoringReference source;
  source.partner.joints = npz.tracks("act_partner", kSmplJoints);
  source.reactor.joints = npz.tracks("act_reactor", kSmplJoints);
  if (npz.contains("act_reshaped")) source.reshaped = npz.tracks("act_reshaped", -1);
  for (const PointTracks* tracks : {&source.partner.joints, &source.reactor.joints, &source.reshaped}) {
    if (tracks->frames() != act_frames(recording) && !(tracks == &source.reshaped && tracks->empty()))
      throw InputError(
          fmt::format("'{}': expected the act's {} frames in 'act_partner', 'act_reactor' and "
                      "'act_reshaped', found {}",
                      npz.name(), act_frames(recording), tracks->frames()));
  }
  return source;
}

}  // namespace

void save_episode_recording(const EpisodeRecording& episode, const std::string& path) {
  Npz npz = recording_npz(episode.recording);
  if (episode.kept) put_kept(npz, *episode.kept);
  npz.save(path);
}

EpisodeRecording read_episode_recording(const Npz& npz) {
  EpisodeRecording episode{read_recording(npz), std::nullopt};
  if (!npz.contains(kRow)) return episode;
  episode.kept = KeptEpisode{get_row(npz), get_rules(npz), get_source(npz, episode.recording)};
  if (episode.recording.partner.empty())
    throw InputError(fmt::format("'{}': expected the key 'partner' beside a row, found none", npz.name()));
  return episode;
}

EpisodeRow score_again(const Recording& recording, const KeptEpisode& kept, const RobotModel& robot) {
  EpisodeRow row = kept.row;
  if (row.robot_digest != robot.digest)
    throw InputError(fmt::format("expected the robot card of digest {:.8} (of {}/{}), found '{}' of digest {:.8}",
                                 row.robot_digest, row.engine, row.controller, robot.name, robot.digest));
  row.verdicts.clear();
  row.metrics.clear();
  for (const std::string& name : measured_metrics())
    if (const auto found = kept.row.metrics.find(name); found != kept.row.metrics.end())
      row.metrics[name] = found->second;
  row.state_hash = state_hash(recording);
  score_recording(recording, kept.source, kept.rules, robot, row);
  return row;
}

}  // namespace duet
