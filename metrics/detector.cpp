#include "duet/metrics/detector.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/tasks/rules/evidence.h"

namespace duet {
namespace {

void check_tracks(Task task, const Tracks& tracks) {
  const Eigen::Index frames = tracks.front().track->cols();
  for (const auto& [name, track] : tracks) {
    require(track->cols() > 0, "{} detector: the track {} is needed and empty", to_string(task), name);
    require(track->cols() == frames, "{} detector: the track {} has {} frames, but {} has {}", to_string(task), name,
            track->cols(), tracks.front().name, frames);
    if (track->allFinite()) continue;
    for (Eigen::Index t = 0; t < frames; ++t)
      require(track->col(t).allFinite(), "{} detector: the track {} is not finite at frame {}", to_string(task), name,
              t);
  }
}

// The task's thresholds with those given in the place of the set's.
Thresholds completed(Task task, const Thresholds& given, ThresholdSet set = ThresholdSet::kPaper) {
  Thresholds complete = thresholds(task, set);
  for (const auto& [name, value] : given) {
    const auto known = complete.find(name);
    if (known == complete.end()) {
      std::vector<std::string> names;
      for (const auto& entry : complete) names.push_back(entry.first);
      throw std::invalid_argument(unknown_name_message(fmt::format("threshold of {}", to_string(task)), name, names));
    }
    require(std::isfinite(value), "threshold {} of {} is not finite", name, to_string(task));
    known->second = value;
  }
  return complete;
}

const ActRule& rule_of(Task task) {
  const ActRule* rule = definition_of(task).rule;
  require(rule != nullptr, "{} detector: the set act has no rule of its own for it", to_string(task));
  return *rule;
}

}  // namespace

std::string_view to_string(DetectorVersion version) {
  if (version == DetectorVersion::kInteraction) return "interaction";
  return version == DetectorVersion::kPaper ? "paper" : "robot";
}
std::string_view to_string(ThresholdSet set) {
  return set == ThresholdSet::kPaper ? "paper" : set == ThresholdSet::kStrict ? "strict" : "act";
}

ThresholdSet parse_threshold_set(std::string_view name) {
  std::vector<std::string> known;
  for (const ThresholdSet set : kThresholdSets) {
    if (name == to_string(set)) return set;
    known.emplace_back(to_string(set));
  }
  throw std::invalid_argument(unknown_name_message("set of thresholds", name, known));
}

Thresholds thresholds(Task task, ThresholdSet set) {
  Thresholds tau;
  if (const ActRule* rule = definition_of(task).rule; set == ThresholdSet::kAct && rule != nullptr) {
    for (const RuleThreshold& threshold : rule->thresholds) tau[std::string(threshold.name)] = threshold.value;
    return tau;
  }
  for (const ThresholdInfo& info : definition_of(task).detector.thresholds)
    tau[std::string(info.name)] = set == ThresholdSet::kPaper ? info.paper : info.strict;
  return tau;
}

DetectorResult detect_performer(Task task, const Agent& performer, const Agent& partner, const Thresholds& thresholds,
                                const DetectorReadings& readings) {
  const TaskDetector& detector = definition_of(task).detector;
  check_tracks(task, detector.tracks(performer, partner, readings));
  return detector.detect(performer, partner, completed(task, thresholds), readings);
}

DetectorResult detect_by_rule(Task task, const Agent& performer, const Agent& partner, const Thresholds& thresholds) {
  const ActRule& rule = rule_of(task);
  check_tracks(task, rule.tracks(performer, partner));
  const Thresholds tau = completed(task, thresholds, ThresholdSet::kAct);
  return rule.detect(rules::smoothed(performer), rules::smoothed(partner), tau);
}

SmoothedAgents smoothed_for_rules(const Agent& performer, const Agent& partner) {
  for (const Task task : all_tasks())
    if (const ActRule* rule = definition_of(task).rule) check_tracks(task, rule->tracks(performer, partner));
  return {rules::smoothed(performer), rules::smoothed(partner)};
}

DetectorResult detect_by_rule(Task task, const SmoothedAgents& agents) {
  return rule_of(task).detect(agents.performer, agents.partner, thresholds(task, ThresholdSet::kAct));
}

DetectorResult detect(Task task, const Agent& human, const Agent& robot, DetectorVersion version, ThresholdSet set,
                      DetectorReadings readings) {
  require(version != DetectorVersion::kInteraction,
          "detector: the rule `interaction` judges an episode, not two agents (metrics/interaction.h)");
  if (set != ThresholdSet::kPaper) readings = strict_readings(readings);
  const bool paper = version == DetectorVersion::kPaper;
  const Agent& performer = paper ? human : robot;
  const Agent& partner = paper ? robot : human;
  if (set == ThresholdSet::kAct && definition_of(task).rule != nullptr)
    return detect_by_rule(task, performer, partner, {});
  return detect_performer(task, performer, partner, thresholds(task, set), readings);
}

}  // namespace duet
