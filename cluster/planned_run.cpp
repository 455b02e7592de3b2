#include "duet/cluster/planned_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

#include "duet/core/digest.h"
#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/execution/run_inputs.h"
#include "duet/rows/folder/name_digests.h"

namespace duet {
namespace {

// Plan and program first: what follows takes seconds.
ShardPlan checked_plan(const std::string& path, const Suite& suite) {
  ShardPlan plan = read_shard_plan(path);
  require_same_program(plan.program, program_digests(suite.engines), path);
  return plan;
}

// That it was planned with.
RunPart part_of(const Run& head) {
  return head.info.plan && head.info.plan->parts.size() == 1 ? head.info.plan->parts.front() : RunPart();
}

// The policies and controllers of a head's suite that the plan leaves out need not be on this machine.
InputPlaces places_of(const Run& head) {
  const RunPart part = part_of(head);
  const Suite suite = parse_suite(head.info.suite_yaml, head.path + "/suite.yaml");
  return {.skipped_policies = left_out(part.policies, policy_names_of(suite)),
          .skipped_controllers = left_out(part.controllers, controller_names_of(suite))};
}

Suite suite_of_planned(const Run& head, bool allow_programs) {
  Suite suite = suite_of_run(head, places_of(head));
  suite.allow_programs = allow_programs;
  return suite;
}

// Clips as far as they are known without their files.
std::vector<PairedMotion> outlines(const ShardPlan& plan, const Suite& suite) {
  std::vector<PairedMotion> clips(suite.references.empty() ? plan.clips.size() : suite.references.size());
  for (std::size_t i = 0; i < clips.size(); ++i) {
    clips[i].clip_id = suite.references.empty() ? plan.clips[i].id : suite.references[i].name;
    if (suite.references.empty()) clips[i].task = parse_task(plan.clips[i].task);
  }
  return clips;
}

Bodies with_outlines(Bodies bodies, const ShardPlan& plan, const Suite& suite) {
  bodies.take_clips(outlines(plan, suite));
  return bodies;
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
  const InputPlaces places = places_of(head);
  if (info.suite_hash != here.suite_hash)
    throw InputError(fmt::format("'{}' was planned with suite {}, which on this machine is {:.12}", path,
                                 suite_label(info), here.suite_hash));
  require_same_digests("policy", info.policies, here.policies, places.skipped_policies, path);
  require_same_digests("controller", info.controllers, here.controllers, places.skipped_controllers, path);
}

}  // namespace

PlannedRun::PlannedRun(std::string path, bool allow_programs)
    : head_(load_run_head(path)),
      plan_(checked_plan(path, parse_suite(head_.info.suite_yaml, path + "/suite.yaml"))),
      suite_(suite_of_planned(head_, allow_programs)),
      bodies_(with_outlines(Bodies(suite_, left_out(part_of(head_).controllers, controller_names_of(suite_)),
                                   left_out(part_of(head_).policies, policy_names_of(suite_))),
                            plan_, suite_)),
      identity_(identity_of(suite_, bodies_.read())),
      episodes_(suite_, bodies_, part_of(head_)) {
  require_planned_identity(head_, identity_, path);
  if (episodes_.size() != plan_.episodes)
    throw InputError(fmt::format("{}/plan.json: expected {} episodes, as its suite has, found {}", path,
                                 episodes_.size(), plan_.episodes));
}

std::string PlannedRun::key_at(std::int64_t place) const {
  const EpisodeSpec spec = episodes_.at(place);
  return row_for(spec, suite_, identity_, *bodies_.robot(spec.controller)).key;
}

void PlannedRun::load_clips(std::int64_t begin, std::int64_t end) {
  if (!suite_.references.empty()) return;
  std::set<std::size_t> needed;
  for (std::int64_t place = begin; place < end; ++place) {
    const EpisodeSpec spec = episodes_.at(place);
    const PairedMotion* const base = bodies_.clips(spec.controller).data();
    for (const PairedMotion* clip : {spec.clip, spec.seen})
      if (clip != nullptr) needed.insert(static_cast<std::size_t>(clip - base));
  }
  std::vector<PairedMotion> clips = outlines(plan_, suite_);
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
  bodies_.take_clips(std::move(clips));
}

std::string keys_digest(const EpisodePlan& episodes, std::int64_t begin, std::int64_t end, const Suite& suite,
                        const RunIdentity& identity, const Bodies& bodies) {
  Sha256 digest;
  for (std::int64_t place = begin; place < end; ++place) {
    const EpisodeSpec spec = episodes.at(place);
    digest.update(row_for(spec, suite, identity, *bodies.robot(spec.controller)).key + "\n");
  }
  return digest.hex();
}

}  // namespace duet
