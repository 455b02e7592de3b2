#include "duet/cluster/plan_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

#include "duet/cluster/attempt.h"
#include "duet/cluster/planned_run.h"
#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/episode_costs.h"
#include "duet/experiment/plan/prepared_clips.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "duet/experiment/work/run_work.h"

namespace duet {
namespace {

constexpr double kLeastCost = 1.0e-3;  // [s/s]: what an absent engine's rows cost

void refuse_planned(const std::string& directory) {
  if (has_shard_plan(directory))
    throw InputError(
        fmt::format("'{}' is planned already: `duet status` says how far it is; choose another folder", directory));
}

std::vector<PlannedClip> keep_clips(const std::vector<PairedMotion>& clips, const std::string& directory) {
  std::vector<PlannedClip> planned;
  for (const PairedMotion& clip : clips) {
    const std::string name = fmt::format("clips/{:06}.npz", planned.size());
    const std::string file = inside(directory, name);
    save_paired_motion(clip, file);
    planned.push_back({std::string(to_string(clip.task)), clip.clip_id, name, sha256_file(file)});
  }
  return planned;
}

// The state of planning a run.
class Planner {
 public:
  Planner(const Experiment& experiment, std::string directory)
      : experiment_(experiment), directory_(std::move(directory)), per_clip_(episodes_of_clip()) {}

  // Runs the first clip of each engine and controller that has no cost yet.
  void measure(std::map<std::string, double>& costs, const StopSign& stop, Progress& progress) {
    progress.start("measuring costs", static_cast<int>(uncosted(costs).size()), "engines and controllers");
    for (const std::int64_t begin : uncosted(costs)) {
      costs[cost_name(experiment_.at(begin))] = std::max(kLeastCost, measured(begin, stop));
      progress.advance();
    }
    progress.finish();
  }

  [[nodiscard]] std::vector<PlanBlock> blocks(const std::map<std::string, double>& costs) const {
    std::vector<PlanBlock> blocks;
    for (std::int64_t begin = 0; begin < experiment_.size(); begin += per_clip_) {
      const EpisodeSpec spec = experiment_.at(begin);
      const double cost = costs.at(cost_name(spec)) * motion_seconds(spec) * static_cast<double>(per_clip_);
      blocks.push_back({spec.engine, begin, begin + per_clip_, cost});
    }
    return blocks;
  }

  [[nodiscard]] std::string keys(const Shard& shard) const { return keys_digest(experiment_, shard.begin, shard.end); }

  // The rows of measure() as attempts at the shards that they are of.
  void keep_pilots(const ShardPlan& plan) const {
    const std::string digest = shard_plan_digest(directory_);
    for (std::size_t i = 0; i < plan.shards.size(); ++i) {
      std::unique_ptr<AttemptWriter> attempt;
      for (const auto& [place, row] : pilots_) {
        if (place < plan.shards[i].begin || place >= plan.shards[i].end) continue;
        if (!attempt)
          attempt = std::make_unique<AttemptWriter>(directory_, new_attempt(static_cast<std::int64_t>(i), digest));
        attempt->append(row);
      }
      if (attempt) attempt->ended("pilot");
    }
  }
  [[nodiscard]] std::size_t pilots() const { return pilots_.size(); }
  [[nodiscard]] std::set<std::string> cost_names() const {
    std::set<std::string> names;
    for (std::int64_t begin = 0; begin < experiment_.size(); begin += per_clip_)
      names.insert(cost_name(experiment_.at(begin)));
    return names;
  }

 private:
  // As long as the clip stays the same.
  [[nodiscard]] std::int64_t episodes_of_clip() const {
    std::int64_t count = 1;
    const EpisodeSpec first = experiment_.at(0);
    const auto same = [&](const EpisodeSpec& spec) {
      return spec.clip == first.clip && cost_name(spec) == cost_name(first) && spec.perturbation == first.perturbation;
    };
    while (count < experiment_.size() && same(experiment_.at(count))) ++count;
    return count;
  }

  [[nodiscard]] std::vector<std::int64_t> uncosted(const std::map<std::string, double>& costs) const {
    std::set<std::string> names;
    std::vector<std::int64_t> places;
    for (std::int64_t begin = 0; begin < experiment_.size(); begin += per_clip_) {
      const std::string name = cost_name(experiment_.at(begin));
      if (!costs.contains(name) && names.insert(name).second) places.push_back(begin);
    }
    return places;
  }

  // All policies on one clip, an episode each. [s of one core per s of motion]
  double measured(std::int64_t begin, const StopSign& stop) {
    double cost = 0.0, motion = 0.0;
    const bool records = experiment_.suite().record != RecordTrajectories::kNone;
    const EpisodeOverrides overrides{.stop_asked = [&] { return stop.asked(); },
                                     .trajectories = records ? inside(directory_, "trajectories") : ""};
    for (std::int64_t place = begin; place < begin + per_clip_; ++place) {
      const EpisodeSpec spec = experiment_.at(place);
      if (spec.episode > 0) break;
      if (stop.asked()) throw Stopped();
      try {
        const EpisodeRow row = experiment_.run(spec, overrides);
        cost += row.wall_s;
        pilots_.emplace_back(place, row);
      } catch (const EpisodeInterrupted&) {
        throw Stopped();
      }
      motion += motion_seconds(spec);
    }
    return cost / motion;
  }

  const Experiment& experiment_;
  std::string directory_;
  std::int64_t per_clip_;
  std::vector<std::pair<std::int64_t, EpisodeRow>> pilots_;
};

std::vector<std::string> lacks(const Experiment& experiment, const RunPart& part) {
  std::vector<std::string> warnings;
  const char* what = "; its episodes are rows with outcome `unsupported`";
  const std::vector<std::string>& engines = experiment.suite().engines;
  for (const std::string& engine : engines)
    if (!can_run_in(engine) && chosen(part.engines, engine))
      warnings.push_back(fmt::format("engine '{}' is absent{}", engine, what));
  for (const auto* absent : {&experiment.bodies().absent(), &experiment.bodies().absent_policies()})
    for (const auto& [name, reason] : *absent) warnings.push_back(reason + what);
  if (std::ranges::none_of(engines, can_run_in))
    throw MissingError(fmt::format("none of the suite's engines is here: {}", fmt::join(engines, ", ")));
  return warnings;
}

void check_costs(const std::map<std::string, double>& costs, const std::set<std::string>& known) {
  for (const auto& [name, cost] : costs)
    require(known.contains(name), "--cost: the suite runs no '{}'; it runs {}", name, fmt::join(known, ", "));
}

}  // namespace

PlanSummary plan_run(Suite suite, const std::string& directory, const PlanOptions& options, const StopSign& stop,
                     Progress& progress) {
  suite.require_clips();
  refuse_planned(directory);
  PlanSummary summary;
  check_filters(options.part, suite);
  ExperimentOptions planned = only(options.part, suite);
  planned.part = options.part;
  Experiment experiment(std::move(suite), std::move(planned));
  const RunIdentity& identity = experiment.identity();
  summary.warnings = lacks(experiment, options.part);
  for (const std::string& note : experiment.bodies().notes()) progress.note(note);
  const KeptSuite kept = kept_suite(experiment.suite(), directory, identity.files);
  RunDirectory run = RunDirectory::open(directory, new_run_info(experiment, kept, options.argv, options.certificate));
  if (run.size() > 0)
    throw InputError(fmt::format("'{}' has {} rows of a `duet run`: plan in another folder", directory, run.size()));
  keep_inputs(kept, directory);
  experiment.prepare(options.threads, progress, {.keep_in = directory, .stop = &stop});
  ShardPlan& plan = summary.plan;
  if (!experiment.suite().is_commanded()) plan.clips = keep_clips(experiment.bodies().clips(), directory);
  Planner planner(experiment, directory);
  check_costs(options.costs, planner.cost_names());
  plan.program = program_digests(experiment.suite().engines);
  plan.suite_hash = identity.suite_hash;
  plan.episodes = experiment.size();
  plan.costs = options.costs;
  planner.measure(plan.costs, stop, progress);
  plan.shards = cut_shards(planner.blocks(plan.costs), options.shards);
  for (Shard& shard : plan.shards) shard.keys = planner.keys(shard);
  run.ask_for(options.part, plan.episodes, [&](const std::vector<RunPart>&) { return plan.episodes; });
  write_shard_plan(plan, directory);
  planner.keep_pilots(plan);
  summary.pilots = static_cast<std::int64_t>(planner.pilots());
  remove_prepared_clips(directory);
  return summary;
}

}  // namespace duet
