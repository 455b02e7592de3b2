#include "duet/execution/decided_run.h"

#include <fmt/format.h>

#include <map>

#include "duet/core/require.h"

namespace duet {
namespace {

TaskClip task_clip_of(const EpisodeSpec& spec) { return {std::string(to_string(spec.clip->task)), spec.clip->clip_id}; }

}  // namespace

DecisionSchedule decision_schedule(const EpisodePlan& plan, const RunPart& part, std::uint64_t seed,
                                   std::size_t episodes_per_look) {
  std::map<TaskClip, std::vector<std::uint32_t>> places;
  for (std::int64_t i = 0; i < plan.size(); ++i) {
    const EpisodeSpec spec = plan.at(i);
    if (belongs(spec, spec.clip->task, part)) places[task_clip_of(spec)].push_back(static_cast<std::uint32_t>(i));
  }
  if (places.empty()) throw InputError("nothing to decide: no episode of the suite belongs to the part asked for");
  std::vector<TaskClip> clips;
  clips.reserve(places.size());
  for (const auto& [clip, of] : places) clips.push_back(clip);
  DecisionSchedule schedule{.rounds = decision_rounds(clips, seed), .looks = {}, .episodes = {}};
  std::vector<std::uint32_t> batch;
  for (std::size_t round = 0; round < schedule.rounds.size(); ++round) {
    for (const TaskClip& clip : schedule.rounds[round])
      batch.insert(batch.end(), places.at(clip).begin(), places.at(clip).end());
    if (batch.size() < episodes_per_look && round + 1 < schedule.rounds.size()) continue;
    schedule.looks.push_back(static_cast<long>(round) + 1);
    schedule.episodes.push_back(std::move(batch));
    batch.clear();
  }
  return schedule;
}

std::vector<EpisodeRow> rows_of_part(std::vector<EpisodeRow> rows, const RunPart& part) {
  std::erase_if(rows, [&](const EpisodeRow& row) {
    const bool perturbed = row.engine == kPlaybackEngine || chosen(part.perturbations, row.perturbation);
    return !chosen(part.engines, row.engine) || !chosen(part.controllers, row.controller) ||
           !chosen(part.policies, row.policy) || !chosen(part.tasks, row.task) || !perturbed;
  });
  return rows;
}

bool is_needed(const EpisodeSpec& spec, const Decision& so_far) {
  return spec.arm == "null" || so_far.is_open(spec.policy->name);
}

std::string decided_run_text(const DecidedRun& run) {
  return fmt::format("{}{}: {} of {} episodes were used, {} runs saved\n", decision_text(run.decision),
                     run.decision.is_decided() ? "decided" : "undecided so far", run.used, run.planned, run.saved());
}

nlohmann::json decided_run_json(const DecidedRun& run) {
  nlohmann::json json = decision_json(run.decision);
  json["planned"] = run.planned;
  json["used"] = run.used;
  json["saved"] = run.saved();
  return json;
}

}  // namespace duet
