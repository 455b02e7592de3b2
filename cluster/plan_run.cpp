#include "duet/cluster/plan_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

#include "duet/cluster/attempt.h"
#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/execution/run_inputs.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "duet/experiment/work/run_work.h"
#include "duet/rows/folder/run_info.h"

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
    const std::string file = join_without_links(directory, name);
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
  void measure(std::map<std::string, double>& costs, const StopToken& stop, Progress& progress) {
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
  double measured(std::int64_t begin, const StopToken& stop) {
    double cost = 0.0, motion = 0.0;
    const bool records = experiment_.suite().record != RecordTrajectories::kNone;
    const EpisodeOverrides overrides{.stop_asked = [&] { return stop.asked(); },
                                     .trajectories = records ? join_without_links(directory_, "trajectories") : ""};
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

std::vector<std::string> lacks(const Experiment& experiment, const EpisodeFilter& part) {
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

PlanSummary plan_run(Suite suite, const std::string& directory, const PlanOptions& options, const StopToken& stop,
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
  const ArchivedSuite kept = archive_inputs(experiment.suite(), directory, identity.files);
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
  run.ask_for(options.part, plan.episodes, [&](const std::vector<EpisodeFilter>&) { return plan.episodes; });
  write_shard_plan(plan, directory);
  planner.keep_pilots(plan);
  summary.pilots = static_cast<std::int64_t>(planner.pilots());
  remove_prepared_clips(directory);
  return summary;
}

namespace {

// Plan and program first: what follows takes seconds.
ShardPlan checked_plan(const std::string& path, const std::vector<std::string>& engines) {
  ShardPlan plan = read_shard_plan(path);
  require_same_program(plan.program, program_digests(engines), path);
  return plan;
}

// That it was planned with.
EpisodeFilter part_of(const Run& head) {
  return head.info.plan && head.info.plan->parts.size() == 1 ? head.info.plan->parts.front() : EpisodeFilter();
}

// The part of a head's suite that is planned; the other policies and controllers need not be on this machine.
ExperimentOptions planned_options(const Run& head) {
  ExperimentOptions options = only(part_of(head), parse_suite(head.info.suite_yaml, head.path + "/suite.yaml"));
  options.part = part_of(head);
  return options;
}

Suite suite_of_planned(const Run& head, bool allow_programs) {
  const ExperimentOptions options = planned_options(head);
  Suite suite = suite_of_run(
      head, {.skipped_policies = options.skipped_policies, .skipped_controllers = options.skipped_controllers});
  suite.allow_programs = allow_programs;
  return suite;
}

// Clips as far as they are known without their files.
std::vector<PairedMotion> outlines(const std::vector<PlannedClip>& planned,
                                   const std::vector<SuiteReference>& references) {
  std::vector<PairedMotion> clips(references.empty() ? planned.size() : references.size());
  for (std::size_t i = 0; i < clips.size(); ++i) {
    clips[i].clip_id = references.empty() ? planned[i].id : references[i].name;
    if (references.empty()) clips[i].task = parse_task(planned[i].task);
  }
  return clips;
}

void require_same_digests(const char* kind, const std::map<std::string, std::string>& planned,
                          const std::map<std::string, std::string>& here, const std::vector<std::string>& skipped,
                          const std::string& path) {
  for (const auto& [name, digest] : planned) {
    if (std::ranges::find(skipped, name) != skipped.end()) continue;
    const auto found = here.find(name);
    const std::string other = found == here.end() ? "" : found->second;
    if (other != digest)
      throw InputError(
          fmt::format("'{}' was planned with {} '{}' {}, this machine has {}: rows of two of one name are "
                      "not one run",
                      path, kind, name, short_digest(digest), short_digest(other)));
  }
}

void require_planned_identity(const Run& head, const RunIdentity& here, const std::string& path) {
  const RunInfo& info = head.info;
  const ExperimentOptions options = planned_options(head);
  if (info.suite_hash != here.suite_hash)
    throw InputError(fmt::format("'{}' was planned with suite {}, which on this machine is {:.12}", path,
                                 suite_label(info), here.suite_hash));
  require_same_digests("policy", info.policies, here.policies, options.skipped_policies, path);
  require_same_digests("controller", info.controllers, here.controllers, options.skipped_controllers, path);
}

}  // namespace

PlannedRun::PlannedRun(std::string path, bool allow_programs)
    : head_(load_run_head(path)),
      plan_(checked_plan(path, parse_suite(head_.info.suite_yaml, path + "/suite.yaml").engines)),
      experiment_(suite_of_planned(head_, allow_programs), planned_options(head_)) {
  experiment_.take_clips(outlines(plan_.clips, experiment_.suite().references));
  require_planned_identity(head_, experiment_.identity(), path);
  if (experiment_.size() != plan_.episodes)
    throw InputError(fmt::format("{}/plan.json: expected {} episodes, as its suite has, found {}", path,
                                 experiment_.size(), plan_.episodes));
}

void PlannedRun::load_clips(std::int64_t begin, std::int64_t end) {
  if (experiment_.suite().is_commanded()) return;
  std::set<std::size_t> needed;
  for (std::int64_t place = begin; place < end; ++place) {
    const EpisodeSpec spec = experiment_.at(place);
    const PairedMotion* const base = experiment_.bodies().clips(spec.controller->name).data();
    for (const PairedMotion* clip : {spec.clip, spec.seen})
      if (clip != nullptr) needed.insert(static_cast<std::size_t>(clip - base));
  }
  std::vector<PairedMotion> clips = outlines(plan_.clips, {});
  for (const std::size_t i : needed) {
    const PlannedClip& clip = plan_.clips.at(i);
    const std::string file = (std::filesystem::path(path()) / clip.file).string();
    FileDigests read;
    const DigestReads reads(read);
    clips[i] = load_paired_motion(file);
    if (const std::string found = read.of(file); found != clip.sha256)
      throw InputError(fmt::format("{}: SHA-256 expected {}, found {}: it is not the clip that was planned with", file,
                                   clip.sha256, found));
  }
  experiment_.take_clips(std::move(clips));
}

std::string keys_digest(const Experiment& experiment, std::int64_t begin, std::int64_t end) {
  Sha256 digest;
  for (std::int64_t place = begin; place < end; ++place) digest.update(experiment.row(place).key + "\n");
  return digest.hex();
}

}  // namespace duet
