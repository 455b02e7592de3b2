#include "duet/experiment/plan/episode.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/experiment/suite/suite.h"
#include "duet/robots/robot_cards.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

// Whether playback under one controller is playback under all; asks what the suite says, not what this machine has.
bool one_playback(const Suite& suite) {
  const auto robot = [&](const SuiteController& controller) {
    if (!suite.robot.empty()) return suite.robot;
    const std::string made_for = about(controller).robot;
    return made_for.empty() ? default_robot() : made_for;
  };
  const SuiteController& first = suite.controllers.front();
  return std::ranges::all_of(suite.controllers, [&](const SuiteController& controller) {
    return robot(controller) == robot(first) && suite.start_of(controller) == suite.start_of(first);
  });
}

const PairedMotion& next_of_task(const std::vector<PairedMotion>& clips, const PairedMotion& clip,
                                 const std::string& policy) {
  const auto own = static_cast<std::size_t>(&clip - clips.data());
  for (std::size_t i = 1; i < clips.size(); ++i) {
    const PairedMotion& other = clips[(own + i) % clips.size()];
    if (other.task == clip.task) return other;
  }
  throw InputError(
      fmt::format("policy '{}' sees the partner of another clip: expected two clips of {} or more, found one", policy,
                  to_string(clip.task)));
}

// Engine, controller and perturbation of all episodes; playback has none.
std::vector<EpisodeSpec> combinations_of(const Suite& suite) {
  std::vector<EpisodeSpec> combinations;
  const bool once = one_playback(suite);
  for (const std::string& engine : suite.engines) {
    for (const SuiteController& controller : suite.controllers) {
      const bool playback = engine == kPlaybackEngine;
      if (playback && once && controller.name != suite.controllers.front().name) continue;
      EpisodeSpec combination;
      combination.engine = engine;
      combination.controller = &controller;
      if (playback) combinations.push_back(combination);
      if (playback) continue;
      for (const Perturbation& perturbation : suite.perturbations) {
        combination.perturbation = &perturbation;
        combination.perturbation_tags = RowTags(tags_of(perturbation));
        combinations.push_back(combination);
      }
    }
  }
  return combinations;
}

std::vector<EpisodeArm> arms_of(const Suite& suite) {
  std::vector<EpisodeArm> arms;
  for (const SuitePolicy& policy : suite.policies)
    if (policy.name != kNullPolicy) arms.push_back({policy, policy.shuffled_partner ? "shuffled" : "main"});
  for (const std::string& control : suite.controls) arms.push_back({SuitePolicy{control}, "control"});
  if (suite.null_arm) arms.push_back({SuitePolicy{kNullPolicy}, "null"});
  return arms;
}

}  // namespace

bool chosen(const std::vector<std::string>& names, std::string_view name) {
  return names.empty() || std::ranges::find(names, name) != names.end();
}

bool can_run_in(const std::string& engine) { return engine == kPlaybackEngine || is_available(engine); }

EpisodePlan::EpisodePlan(const Suite& suite, const Embodiments& bodies, const EpisodeFilter& part)
    : suite_(suite),
      bodies_(bodies),
      suite_id_(suite.draws_of.empty() ? suite.name + "@" + suite.version : suite.draws_of),
      combinations_(combinations_of(suite)),
      arms_(arms_of(suite)) {
  const std::vector<PairedMotion>& clips = bodies.clips();
  require_sane_size(suite, static_cast<std::int64_t>(clips.size()));
  for (const EpisodeArm& arm : arms_)
    for (const PairedMotion& clip : clips)
      if (arm.policy.shuffled_partner) static_cast<void>(next_of_task(clips, clip, arm.policy.name));
  std::erase_if(combinations_, [&](const EpisodeSpec& spec) {
    return !chosen(part.engines, spec.engine) || !chosen(part.controllers, spec.controller->name) ||
           (spec.engine != kPlaybackEngine && !chosen(part.perturbations, spec.perturbation->name));
  });
  std::erase_if(arms_,
                [&](const EpisodeArm& arm) { return arm.name != "null" && !chosen(part.policies, arm.policy.name); });
  for (EpisodeSpec& spec : combinations_) {
    spec.body = &bodies.controller(spec.controller->name);
    if (spec.engine == kPlaybackEngine)
      spec.perturbation = &clean_;
    else
      spec.settings = &settings_.try_emplace(spec.engine, suite.profile.settings(spec.engine)).first->second;
  }
  for (std::size_t of = 0; of < combinations_.size(); ++of)
    for (std::size_t i = 0; i < clips.size(); ++i)
      if (chosen(part.tasks, to_string(clips[i].task)) && is_run_under(suite, i, combinations_[of]))
        cells_.push_back({of, i});
  if (!part.is_whole() && size() == 0)
    throw InputError(fmt::format("{}: no episode is in what was asked for", suite.file));
}

std::int64_t EpisodePlan::size() const {
  return static_cast<std::int64_t>(cells_.size() * arms_.size()) * suite_.episodes_per_clip;
}

EpisodeSpec EpisodePlan::at(std::int64_t i) const {
  const auto arms = static_cast<std::int64_t>(arms_.size());
  const Cell& cell = cells_[i / (arms * suite_.episodes_per_clip)];
  const EpisodeArm& arm = arms_[i % arms];
  EpisodeSpec spec = combinations_[cell.combination];
  const std::vector<PairedMotion>& clips = bodies_.clips(spec.controller->name);
  spec.clip = &clips[cell.clip];
  spec.episode = static_cast<int>(i / arms % suite_.episodes_per_clip);
  spec.policy = &arm.policy;
  spec.leader = bodies_.policy(spec.controller->name, arm.policy.name);
  spec.seen = arm.policy.shuffled_partner ? &next_of_task(clips, *spec.clip, arm.policy.name) : nullptr;
  if (suite_.is_commanded()) spec.reference = &reference_of(suite_.references, spec.clip->clip_id);
  spec.arm = arm.name;
  spec.seed = seed(*spec.clip, spec.episode, "episode");
  spec.perturbation_seed = seed(*spec.clip, spec.episode, "perturbation");
  return spec;
}

std::uint64_t EpisodePlan::seed(const PairedMotion& clip, int episode, const char* stream) const {
  return suite_.seed + stream_key({suite_id_, to_string(clip.task), clip.clip_id, std::to_string(episode), stream});
}

std::vector<std::string> left_out(const std::vector<std::string>& filter, const std::vector<std::string>& known) {
  std::vector<std::string> names;
  for (const std::string& name : known)
    if (!chosen(filter, name)) names.push_back(name);
  return names;
}

void check_filters(const EpisodeFilter& part, const Suite& suite) {
  const auto check = [](const std::vector<std::string>& filter, const std::vector<std::string>& known,
                        const char* kind) {
    for (const std::string& name : filter)
      require(std::ranges::find(known, name) != known.end(), "the suite has no {} '{}'; it has: {}", kind, name,
              fmt::join(known, ", "));
  };
  std::vector<std::string> tasks;
  for (const Task task : suite.tasks) tasks.emplace_back(to_string(task));
  check(part.engines, suite.engines, "engine");
  check(part.controllers, suite.controller_names(), "controller");
  std::vector<std::string> policies = suite.policy_names();
  policies.insert(policies.end(), suite.controls.begin(), suite.controls.end());
  check(part.policies, policies, "policy");
  check(part.tasks, tasks, "task");
  check(part.perturbations, suite.perturbation_names(), "perturbation");
}

bool is_run_under(const Suite& suite, std::size_t clip, const EpisodeSpec& spec) {
  return !suite.is_commanded() || spec.engine == kPlaybackEngine ||
         chosen(suite.references.at(clip).perturbations, spec.perturbation->name);
}

bool belongs(const EpisodeSpec& spec, Task task, const EpisodeFilter& part) {
  return chosen(part.engines, spec.engine) && chosen(part.controllers, spec.controller->name) &&
         (spec.arm == "null" || chosen(part.policies, spec.policy->name)) && chosen(part.tasks, to_string(task)) &&
         (spec.engine == kPlaybackEngine || chosen(part.perturbations, spec.perturbation->name));
}

std::int64_t count_episodes(const Suite& suite, const std::vector<Task>& clips,
                            const std::vector<EpisodeFilter>& parts) {
  std::int64_t total = 0;
  const std::vector<EpisodeArm> arms = arms_of(suite);
  for (EpisodeSpec spec : combinations_of(suite)) {
    for (const EpisodeArm& arm : arms) {
      spec.policy = &arm.policy;
      spec.arm = arm.name;
      for (std::size_t i = 0; i < clips.size(); ++i)
        total += is_run_under(suite, i, spec) &&
                 std::ranges::any_of(parts, [&](const EpisodeFilter& part) { return belongs(spec, clips[i], part); });
    }
  }
  return total * suite.episodes_per_clip;
}

void require_sane_size(const Suite& suite, std::int64_t clips) {
  const double episodes = static_cast<double>(combinations_of(suite).size()) *
                          static_cast<double>(arms_of(suite).size()) * static_cast<double>(clips) *
                          suite.episodes_per_clip;
  if (episodes > static_cast<double>(kMostEpisodes))
    throw InputError(fmt::format("{}: expected at most {} episodes, found {:.0f} ({} clips, {} episodes per clip)",
                                 suite.file, kMostEpisodes, episodes, clips, suite.episodes_per_clip));
}

std::string cost_name(const EpisodeSpec& spec) { return fmt::format("{}/{}", spec.engine, spec.controller->name); }

double motion_seconds(const EpisodeSpec& spec) {
  if (spec.reference != nullptr) return spec.reference->seconds;
  return static_cast<double>(spec.clip->robot.frames()) / spec.clip->robot.rate_hz;
}

void EpisodeCosts::expect(const EpisodeSpec& spec) {
  const std::lock_guard lock(mutex_);
  work_[cost_name(spec)].left += motion_seconds(spec);
}

void EpisodeCosts::ended(const EpisodeSpec& spec, double wall_s) {
  const double motion = motion_seconds(spec);
  const std::lock_guard lock(mutex_);
  Work& work = work_[cost_name(spec)];
  work.left = std::max(work.left - motion, 0.0);
  work.done += motion;
  work.wall += wall_s;
}

double EpisodeCosts::share_done() const {
  const std::lock_guard lock(mutex_);
  double done = 0.0, left = 0.0;
  for (const auto& [name, work] : work_) {
    if (work.done == 0.0 && work.left > 0.0) return std::numeric_limits<double>::quiet_NaN();
    done += work.wall;
    if (work.done > 0.0) left += work.wall / work.done * work.left;
  }
  return done > 0.0 ? done / (done + left) : std::numeric_limits<double>::quiet_NaN();
}

namespace {

void add_tags(std::string_view of, const Tags& tags, Tags& into) {
  for (const auto& [name, value] : tags) into.insert_or_assign(row_tag(of, name), value);
}

}  // namespace

Tags with_named_tags(Tags of_perturbation, const SuitePolicy& policy, const SuiteReference* command) {
  Tags tags = std::move(of_perturbation);
  if (command == nullptr)
    add_tags(kOfPolicy, policy.tags, tags);
  else
    add_tags(kOfClip, command->tags, tags);
  return tags;
}

Tags episode_tags(const EpisodeSpec& spec) {
  Tags tags = with_named_tags(spec.perturbation_tags.map(), *spec.policy, spec.reference);
  tags.insert(spec.clip->tags.begin(), spec.clip->tags.end());
  return tags;
}

}  // namespace duet
