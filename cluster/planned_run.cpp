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
ShardPlan checked_plan(const std::string& path, const std::vector<std::string>& engines) {
  ShardPlan plan = read_shard_plan(path);
  require_same_program(plan.program, program_digests(engines), path);
  return plan;
}

// That it was planned with.
RunPart part_of(const Run& head) {
  return head.info.plan && head.info.plan->parts.size() == 1 ? head.info.plan->parts.front() : RunPart();
}

// What of a head's suite is planned; the other policies and controllers need not be on this machine.
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
