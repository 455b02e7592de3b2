#include "duet/execution/runner.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/execution/run_inputs.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/work/run_work.h"
#include "duet/rows/folder/environment.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

EpisodeFilter part_of(const RunOptions& options) {
  EpisodeFilter part = options;
  if (options.decide.asked()) part.policies = options.decide.policies;
  return part;
}

// Throws for what no decision can be of.
void check_decision_of(const RunOptions& options, bool is_commanded) {
  if (!options.decide.asked()) return;
  check_decision(options.decide);
  require(options.policies.empty(), "--until-decided names the policies that run: leave --policies out");
  if (is_commanded) throw InputError("--until-decided: expected a suite of clips, found one of walking commands");
}

// `engines`: of a suite.
bool plays_back(const std::vector<std::string>& engines, const RunOptions& options) {
  return std::ranges::find(engines, kPlaybackEngine) != engines.end() && chosen(options.engines, kPlaybackEngine);
}

// Engines of the suite that this machine lacks, or that lack a solid partner where the suite has one, each with its
// reason. Throws MissingError where no other is left.
std::map<std::string, std::string> absent_engines(const Suite& suite, const RunOptions& options) {
  const std::vector<std::string>& named = suite.engines;
  std::map<std::string, std::string> absent;
  int present = plays_back(named, options) ? 1 : 0;
  for (const EngineInfo& engine : engines()) {
    if (std::ranges::find(named, engine.name) == named.end() || !chosen(options.engines, engine.name)) continue;
    const std::string refusal = refusal_of(engine.name, scene_mode(suite.partner));
    if (!engine.available)
      absent[engine.name] = fmt::format("engine '{}' is absent: {}", engine.name, engine.reason);
    else if (!refusal.empty())
      absent[engine.name] = refusal;
    else
      ++present;
  }
  if (present == 0 && !absent.empty()) throw MissingError(absent.begin()->second);
  return absent;
}

// Throws MissingError where all policies are absent, or all controllers and nothing is left that runs without one.
void check_actors(const Experiment& experiment, const RunOptions& options) {
  const auto& [absent, absent_policies] = std::tie(experiment.bodies().absent(), experiment.bodies().absent_policies());
  const auto wanted = [](const std::vector<std::string>& chosen, const std::vector<std::string>& names) {
    return names.size() - left_out(chosen, names).size();
  };
  const std::size_t policies = wanted(part_of(options).policies, experiment.suite().policy_names());
  if (!absent_policies.empty() && absent_policies.size() == policies)
    throw MissingError(absent_policies.begin()->second);
  const std::size_t controllers = wanted(options.controllers, experiment.suite().controller_names());
  if (!absent.empty() && absent.size() == controllers && !plays_back(experiment.suite().engines, options))
    throw MissingError(absent.begin()->second);
}

std::string no_locks_warning(const std::string& folder, const std::string& reason) {
  return fmt::format("'{}' is on a file system without locks ({}): let no other run work in it at the same time",
                     folder, reason);
}

// The settings under profile_digest, for people. The suite says less; another machine's engines may add other defaults.
std::string settings_here(const std::vector<std::string>& engines, const Profile& profile) {
  std::string text;
  for (const std::string& engine : engines)
    if (engine != kPlaybackEngine && is_available(engine))
      text += fmt::format("# {} here: {}\n", engine, resolved_settings(engine, profile.settings(engine)));
  return text;
}

}  // namespace

RunInfo new_run_info(const Experiment& experiment, const ArchivedSuite& kept, const std::vector<std::string>& argv,
                     const nlohmann::json& certificate) {
  const RunIdentity& identity = experiment.identity();
  return {.suite = kept.suite.name,
          .suite_version = kept.suite.version,
          .suite_hash = identity.suite_hash,
          .suite_yaml = resolved_yaml(kept.suite) + settings_here(kept.suite.engines, kept.suite.profile),
          .argv = argv,
          .created_at = utc_now(),
          .environment = capture_environment(),
          .policies = identity.policies,
          .controllers = identity.controllers,
          .certificate = certificate,
          .plan = {}};
}

namespace {

// Places in the plan of those that are asked for and not in the folder yet; counts those that are.
std::vector<std::uint32_t> missing_episodes(const Experiment& experiment, const EpisodeFilter& part,
                                            const RunDirectory& run, const StopToken& stop, RunSummary& summary) {
  std::vector<std::uint32_t> missing;
  for (std::int64_t i = 0; i < experiment.size(); ++i) {
    if (i % 256 == 0 && stop.asked()) throw Stopped();
    const EpisodeSpec spec = experiment.at(i);
    if (!belongs(spec, spec.clip->task, part)) continue;
    if (run.size() > 0 && run.has(experiment.row(spec).key)) {
      ++summary.already_there;
      ++summary.there_of[spec.policy->name];
    } else {
      missing.push_back(static_cast<std::uint32_t>(i));
    }
  }
  return missing;
}

std::vector<Task> tasks_of(const std::vector<PairedMotion>& clips) {
  std::vector<Task> tasks;
  tasks.reserve(clips.size());
  for (const PairedMotion& clip : clips) tasks.push_back(clip.task);
  return tasks;
}

// Says in the folder and in the summary what was asked for.
void ask_for(const Experiment& experiment, const std::vector<Task>& clips, const RunOptions& options, RunDirectory& run,
             RunSummary& summary) {
  const auto count = [&](const std::vector<EpisodeFilter>& parts) {
    return count_episodes(experiment.suite(), clips, parts);
  };
  summary.planned = count({part_of(options)});
  run.ask_for(part_of(options), count({EpisodeFilter()}), count);
}

// Episodes that are run into a folder.
struct Rollouts {
  const Experiment& experiment;
  const StopToken& stop;
  EpisodeCosts& costs;
  int threads = 1;

  // Those at these places of the plan.
  void run(const std::vector<std::uint32_t>& places, RunDirectory& folder, Progress& progress,
           RunSummary& summary) const {
    const bool records = experiment.suite().record != RecordTrajectories::kNone;
    const EpisodeOverrides overrides{.stop_asked = [&] { return stop.asked(); },
                                     .trajectories = records ? join_without_links(folder.path(), "trajectories") : ""};
    EpisodeDispatcher work(folder, stop);
    const auto key_at = [&](int i) { return experiment.row(places[i]).key; };
    const auto run_at = [&](int i) {
      const EpisodeSpec spec = experiment.at(places[i]);
      EpisodeRow row = experiment.run(spec, overrides);
      costs.ended(spec, row.wall_s);
      progress.set_share(costs.share_done());
      return row;
    };
    work.run(static_cast<int>(places.size()), threads, key_at, run_at, progress);
    summary.run += work.done();
    for (const auto& [outcome, count] : work.outcomes()) summary.outcomes[outcome] += count;
    summary.already_there += work.done_by_others();
    if (summary.first_error.empty()) summary.first_error = work.first_error();
  }
};

// Look by look, until the policies are told apart or all clips are done. Nothing of it depends on the rows that were
// there before but the work that they save.
void run_until_decided(const Rollouts& rollouts, const RunOptions& options, const std::vector<std::uint32_t>& missing,
                       Progress& progress, RunDirectory& run, RunSummary& summary) {
  const EpisodeFilter part = part_of(options);
  const DecisionSchedule schedule =
      decision_schedule(rollouts.experiment.plan(), part, rollouts.experiment.suite().seed, options.episodes_per_look);
  DecidedRun decided{.decision = decide({}, schedule.rounds, {}, options.decide), .planned = summary.planned};
  progress.start("rolling out until decided", static_cast<int>(missing.size()), "episodes at most");
  for (std::size_t look = 0; look < schedule.looks.size() && !decided.decision.is_decided(); ++look) {
    std::vector<std::uint32_t> places;
    for (const std::uint32_t place : schedule.episodes[look]) {
      if (!is_needed(rollouts.experiment.at(place), decided.decision)) continue;
      ++decided.used;
      if (std::ranges::binary_search(missing, place)) places.push_back(place);
    }
    rollouts.run(places, run, progress, summary);
    if (rollouts.stop.asked()) break;
    decided.decision =
        decide(rows_of_part(load_run(run.path()).rows, part), schedule.rounds,
               {schedule.looks.begin(), schedule.looks.begin() + static_cast<long>(look) + 1}, options.decide);
    write_file(join_without_links(run.path(), "decision.json"), dumped(decided_run_json(decided), 2) + "\n");
    summary.decided = decided;
  }
  progress.finish();
}

// The first episode of each engine, controller and arm before all others: the time that is left is known when they end.
std::vector<std::uint32_t> pilots_first(const EpisodePlan& plan, const std::vector<std::uint32_t>& places) {
  std::set<std::string> seen;
  std::vector<std::uint32_t> first, rest;
  for (const std::uint32_t place : places) {
    const EpisodeSpec spec = plan.at(place);
    const bool is_first = seen.insert(fmt::format("{}/{}/{}", cost_name(spec), spec.arm, spec.policy->name)).second;
    (is_first ? first : rest).push_back(place);
  }
  first.insert(first.end(), rest.begin(), rest.end());
  return first;
}

// Runs what is missing.
void run_missing(const Experiment& experiment, const RunOptions& options, const StopToken& stop, Progress& progress,
                 RunDirectory& run, RunSummary& summary) {
  EpisodeCosts costs;
  const Rollouts rollouts{experiment, stop, costs, options.threads};
  const std::vector<std::uint32_t> missing = missing_episodes(experiment, part_of(options), run, stop, summary);
  for (const std::uint32_t place : missing) costs.expect(experiment.at(place));
  if (options.decide.asked()) {
    run_until_decided(rollouts, options, missing, progress, run, summary);
    return;
  }
  progress.start("rolling out", static_cast<int>(missing.size()), "episodes");
  progress.set_share(costs.share_done());
  rollouts.run(pilots_first(experiment.plan(), missing), run, progress, summary);
  progress.finish();
}

// The suite hash says nothing of policies and engines; a folder is of those that its suite.yaml names.
void require_names_of(const std::string& directory, const std::vector<std::string>& policies,
                      const std::vector<std::string>& engines) {
  const std::string path = (std::filesystem::path(directory) / "suite.yaml").string();
  if (!has_inputs(directory)) return;  // a run that was killed before its first episode, or none
  const Suite there = parse_run_suite(read_text(path), path);
  const auto require_all = [&](const char* kind, const std::vector<std::string>& known,
                               const std::vector<std::string>& wanted) {
    for (const std::string& name : wanted)
      if (!chosen(known, name))
        throw InputError(
            fmt::format("'{}' holds a run of the {} {}, not of '{}': choose another folder (`duet merge` "
                        "joins two)",
                        directory, kind, fmt::join(known, ", "), name));
  };
  require_all("policies", there.policy_names(), policies);
  require_all("engines", there.engines, engines);
}

// In suite.yaml, where policies have taken the place of others of their names: their options.
void say_replaced(const std::string& directory, const std::vector<SuitePolicy>& policies,
                  const std::vector<std::string>& replaced) {
  if (replaced.empty()) return;
  const std::string path = join_without_links(directory, "suite.yaml");
  const std::string before = read_text(path);
  const Suite there = parse_run_suite(before, path);
  std::string text = before;
  for (const SuitePolicy& old : there.policies)
    for (const SuitePolicy& now : policies) {
      if (now.name != old.name || std::ranges::find(replaced, now.name) == replaced.end()) continue;
      for (const auto& [option, value] : now.options) {
        const auto found = old.options.find(option);
        if (found == old.options.end() || found->second.empty() || found->second == value) continue;
        const std::size_t place = text.find(found->second);
        if (place != std::string::npos) text.replace(place, found->second.size(), value);
      }
    }
  if (text != before) write_file(path, text);
}

}  // namespace

RunSummary run_suite(Suite suite, const std::string& directory, const RunOptions& options, Progress& progress) {
  suite.require_clips();
  check_filters(options, suite);
  check_filters(part_of(options), suite);
  check_decision_of(options, suite.is_commanded());
  RunSummary summary;
  summary.absent_engines = absent_engines(suite, options);
  ExperimentOptions loaded = only(part_of(options), suite);
  loaded.called = options.called;
  Experiment experiment(std::move(suite), std::move(loaded));
  check_actors(experiment, options);
  for (const std::string& note : experiment.bodies().notes()) progress.note(note);
  summary.absent_controllers = experiment.bodies().absent();
  summary.absent_policies = experiment.bodies().absent_policies();
  const ArchivedSuite kept = archive_inputs(experiment.suite(), directory, experiment.identity().files);
  const RunInfo info = new_run_info(experiment, kept, options.argv, options.certificate);
  require_names_of(directory, kept.suite.policy_names(), kept.suite.engines);
  RunDirectory run = RunDirectory::open(directory, info, options.retry_errors, options.replaced);
  say_replaced(directory, experiment.suite().policies, options.replaced);
  keep_inputs(kept, directory);
  if (!run.lock_refusal().empty()) summary.warnings.push_back(no_locks_warning(directory, run.lock_refusal()));
  const StopToken stop(options.time_limit, options.begin, options.stop_asked);
  try {
    const bool made = experiment.suite().clips.files.empty();
    if (made) ask_for(experiment, experiment.suite().tasks_of_own_clips(), options, run, summary);
    const std::string& kept_in = options.clips_in.empty() ? directory : options.clips_in;
    experiment.prepare(options.threads, progress, {.keep_in = kept_in, .stop = &stop});
    if (!made) ask_for(experiment, tasks_of(experiment.bodies().clips()), options, run, summary);
    run_missing(experiment, options, stop, progress, run, summary);
  } catch (const Stopped&) {
    summary.end = stop.end();
    return summary;
  }
  if (summary.already_there + summary.run < summary.planned) summary.end = stop.end();
  if (run.is_finished()) remove_prepared_clips(directory);
  return summary;
}

namespace {

TaskClip task_clip_of(const EpisodeSpec& spec) { return {std::string(to_string(spec.clip->task)), spec.clip->clip_id}; }

}  // namespace

DecisionSchedule decision_schedule(const EpisodePlan& plan, const EpisodeFilter& part, std::uint64_t seed,
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

std::vector<EpisodeRow> rows_of_part(std::vector<EpisodeRow> rows, const EpisodeFilter& part) {
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
