#include "duet/bench/verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <tuple>
#include <unordered_map>

#include "duet/bench/bodies.h"
#include "duet/bench/clips.h"
#include "duet/bench/episode.h"
#include "duet/bench/run_inputs.h"
#include "duet/bench/runner.h"
#include "duet/bench/suite_names.h"
#include "duet/core/parallel.h"
#include "duet/core/random.h"
#include "duet/core/require.h"
#include "duet/metrics/detector.h"
#include "duet/results/rows/name_digests.h"
#include "duet/results/rows/published.h"

namespace duet {
namespace {

// What filters take or leave as a whole.
using Block = std::tuple<std::string, std::string, std::string, std::string, std::string>;

Block block_of(const EpisodeRow& row) { return {row.engine, row.controller, row.policy, row.perturbation, row.task}; }

constexpr std::array kNames = {&EpisodeRow::engine, &EpisodeRow::controller, &EpisodeRow::task,
                               &EpisodeRow::perturbation, &EpisodeRow::policy};
using NamesOfRows = std::array<std::set<std::string>, kNames.size()>;

std::string text_of(const Block& block) {
  const auto& [engine, controller, policy, perturbation, task] = block;
  return fmt::format("{} of {}/{}/{} {}", task, engine, controller, policy, perturbation);
}

std::string text_of(const EpisodeRow& row) {
  return fmt::format("{} {} of {}/{}/{} {} ({} arm)", row.clip, row.episode, row.engine, row.controller, row.policy,
                     row.perturbation, row.arm);
}

// Names of the suite that no row has need not be on this machine.
std::vector<std::string> without_rows(const Run& run, const std::vector<std::string>& names,
                                      std::string EpisodeRow::*field) {
  std::set<std::string> used;
  for (const EpisodeRow& row : run.rows) used.insert(row.*field);
  std::vector<std::string> skipped;
  for (const std::string& name : names)
    if (!used.contains(name)) skipped.push_back(name);
  return skipped;
}

void check_actors(const char* kind, const std::map<std::string, std::string>& claimed,
                  const std::map<std::string, std::string>& found, const std::vector<std::string>& skipped) {
  for (const auto& [name, digest] : found) {
    if (std::ranges::find(skipped, name) != skipped.end()) continue;
    const auto claim = claimed.find(name);
    const std::string expected = claim == claimed.end() ? "" : claim->second;
    if (!expected.empty() && expected != digest)
      throw InputError(fmt::format("{} '{}': run.json says {}, this machine has {}", kind, name, short_digest(expected),
                                   short_digest(digest)));
  }
}

class Verifier {
 public:
  Verifier(const Run& run, const VerifyOptions& options, Progress& progress)
      : run_(run),
        options_(options),
        progress_(progress),
        suite_(read_suite()),
        bodies_(suite_, skipped_controllers_, skipped_policies_) {
    check_identity();
    bodies_.take_clips(prepare_clips(suite_, *bodies_.nominal(), options_.threads, progress_));
    plan_ = plan_episodes(suite_, bodies_);
    for (std::size_t i = 0; i < plan_.size(); ++i) planned_.push_back(row_of(plan_[i]));
    for (std::size_t i = 0; i < plan_.size(); ++i) place_[planned_[i].key] = i;
  }

  Verification verify() {
    for (const EpisodeRow& row : run_.rows) check_row(row);
    check_missing();
    repeat();
    return std::move(result_);
  }

  std::map<std::string, std::string> record(const std::vector<std::string>& keys, const std::string& folder) {
    suite_.record = RecordTrajectories::kAll;  // only now: it is in the suite's hash
    std::vector<std::string> hashes(keys.size());
    progress_.start("running again", static_cast<int>(keys.size()), "episodes");
    parallel_for_each(static_cast<int>(keys.size()), options_.threads, [&](int i) {
      const auto place = place_.find(keys[i]);
      if (place == place_.end())
        throw InputError(fmt::format("'{}': episode {:.16} is no episode of its suite", run_.path, keys[i]));
      hashes[i] = run_planned(plan_[place->second], folder).state_hash;
      progress_.advance();
    });
    progress_.finish();
    std::map<std::string, std::string> by_key;
    for (std::size_t i = 0; i < keys.size(); ++i) by_key[keys[i]] = hashes[i];
    return by_key;
  }

 private:
  Suite read_suite() {
    const Suite named = parse_suite(run_.info.suite_yaml, run_.path + "/suite.yaml");
    skipped_policies_ = without_rows(run_, policy_names_of(named), &EpisodeRow::policy);
    skipped_controllers_ = without_rows(run_, controller_names_of(named), &EpisodeRow::controller);
    Suite suite = suite_of_run(run_, {skipped_policies_, skipped_controllers_, options_.clips});
    suite.allow_programs = options_.allow_programs;
    return suite;
  }

  void check_identity() {
    for (const EpisodeRow& row : run_.rows)
      if (row.detectors != kDetectorsVersion)
        throw InputError(fmt::format("'{}': its rows were judged by detectors {}, this program has {}", run_.path,
                                     row.detectors, kDetectorsVersion));
    identity_ = identity_of(suite_);
    if (identity_.suite_hash != run_.info.suite_hash)
      throw InputError(fmt::format(
          "'{}': suite.yaml, with its inputs and this program's robots and limits, has the hash {}, run.json says {}",
          run_.path, short_digest(identity_.suite_hash), short_digest(run_.info.suite_hash)));
    check_actors("policy", run_.info.policies, identity_.policies, skipped_policies_);
    check_actors("controller", run_.info.controllers, identity_.controllers, skipped_controllers_);
  }

  [[nodiscard]] EpisodeRow row_of(const EpisodeSpec& spec) const {
    return row_for(spec, suite_, identity_, *bodies_.robot(spec.controller));
  }

  // What is known of an episode before it runs.
  void check_row(const EpisodeRow& row) {
    const auto place = place_.find(row.key);
    if (place == place_.end()) {
      result_.faults.push_back(fmt::format("{}: is no episode of the suite", text_of(row)));
      return;
    }
    const EpisodeRow& planned = planned_[place->second];
    const bool ran = row.outcome != Outcome::kUnsupported && can_run_in(row.engine);
    const auto check = [&](const char* field, const auto& expected, const auto& found) {
      if (expected != found)
        result_.faults.push_back(
            fmt::format("{}: {}: expected '{}', found '{}'", text_of(row), field, expected, found));
    };
    check("suite", planned.suite, row.suite);
    check("suite_version", planned.suite_version, row.suite_version);
    check("seed", planned.seed, row.seed);
    check("engine_profile", planned.engine_profile, row.engine_profile);
    if (ran) check("profile_digest", planned.profile_digest, row.profile_digest);
    if (ran) check("robot_digest", planned.robot_digest, row.robot_digest);
  }

  // What run.json says that was asked for must be there.
  void check_missing() {
    std::set<std::string> keys;
    NamesOfRows ran;
    for (const EpisodeRow& row : run_.rows) {
      keys.insert(row.key);
      for (std::size_t i = 0; i < kNames.size(); ++i) ran[i].insert(row.*kNames[i]);
    }
    std::map<Block, std::pair<int, int>> counts;  // missing, all
    for (std::size_t i = 0; i < plan_.size(); ++i) {
      const EpisodeRow& row = planned_[i];
      if (!is_wanted(plan_[i], row, ran)) continue;
      auto& [missing, all] = counts[block_of(row)];
      ++all;
      if (!keys.contains(row.key)) ++missing;
    }
    for (const auto& [block, count] : counts)
      if (count.first > 0)
        result_.missing.push_back(
            fmt::format("{}: {} of {} episodes are not in the run", text_of(block), count.first, count.second));
  }

  // A run without a plan is taken for one part: of names that have rows, every combination.
  [[nodiscard]] bool is_wanted(const EpisodeSpec& spec, const EpisodeRow& row, const NamesOfRows& ran) const {
    if (run_.info.plan)
      return std::ranges::any_of(run_.info.plan->parts,
                                 [&](const RunPart& part) { return belongs(spec, spec.clip->task, part); });
    for (std::size_t i = 0; i < kNames.size(); ++i) {
      const bool of_no_policy = kNames[i] == &EpisodeRow::policy && row.arm == "null";
      if (!of_no_policy && !ran[i].contains(row.*kNames[i])) return false;
    }
    return true;
  }

  [[nodiscard]] bool is_repeatable(const EpisodeRow& row) const {
    const bool here = can_run_in(row.engine) && !bodies_.absent().contains(row.controller);
    return here && row.outcome != Outcome::kTimedOut && row.outcome != Outcome::kUnsupported;
  }

  // Without replacement, from a seeded shuffle; in the order of the run.
  std::vector<const EpisodeRow*> sample() {
    std::vector<const EpisodeRow*> rows;
    for (const EpisodeRow& row : run_.rows)
      if (place_.contains(row.key)) (is_repeatable(row) ? rows.push_back(&row) : void(++result_.not_repeatable));
    result_.repeatable = static_cast<int>(rows.size());
    if (options_.all) return rows;
    Random random(options_.seed, stream_key({"verify"}));
    for (std::size_t i = 0; i + 1 < rows.size(); ++i)
      std::swap(rows[i], rows[i + static_cast<std::size_t>(random.below(static_cast<int>(rows.size() - i)))]);
    rows.resize(std::min(rows.size(), static_cast<std::size_t>(options_.episodes)));
    std::ranges::sort(rows);
    return rows;
  }

  void repeat() {
    const std::vector<const EpisodeRow*> rows = sample();
    result_.repeats.resize(rows.size());
    const bool published = is_published(run_.path);  // without what plots of single episodes need
    progress_.start("running again", static_cast<int>(rows.size()), "episodes");
    parallel_for_each(static_cast<int>(rows.size()), options_.threads, [&](int i) {
      result_.repeats[i] = repeated(*rows[i], !published);
      progress_.advance();
    });
    progress_.finish();
  }

  [[nodiscard]] RepeatedEpisode repeated(const EpisodeRow& row, bool with_traces) const {
    EpisodeRow now = run_planned(plan_[place_.at(row.key)], "");
    if (!with_traces) {
      now.trace = {};
      now.feet = {};
    }
    return {row, now.state_hash, row_differences(row, now)};
  }

  [[nodiscard]] EpisodeRow run_planned(const EpisodeSpec& spec, const std::string& folder) const {
    if (!can_run_in(spec.engine)) throw MissingError(fmt::format("engine '{}' is not on this machine", spec.engine));
    if (const auto absent = bodies_.absent().find(spec.controller); absent != bodies_.absent().end())
      throw MissingError(absent->second);
    const PolicyOnBody& policy = bodies_.policy(spec.controller, spec.policy);
    if (!policy.refusal.empty()) throw MissingError(policy.refusal);
    return run_episode(spec, suite_, identity_, bodies_.robot(spec.controller), folder, {.policy = policy.make});
  }

  const Run& run_;
  const VerifyOptions& options_;
  Progress& progress_;
  std::vector<std::string> skipped_policies_, skipped_controllers_;
  Suite suite_;
  Bodies bodies_;
  RunIdentity identity_;
  std::vector<EpisodeSpec> plan_;
  std::vector<EpisodeRow> planned_;                     // as known before they run
  std::unordered_map<std::string, std::size_t> place_;  // of a key in both
  Verification result_;
};

}  // namespace

int Verification::different() const {
  return static_cast<int>(
      std::ranges::count_if(repeats, [](const RepeatedEpisode& repeat) { return !repeat.differences.empty(); }));
}

Verification verify_run(const Run& run, const VerifyOptions& options, Progress& progress) {
  if (run.rows.empty()) throw InputError(fmt::format("'{}' has no episode to run again", run.path));
  return Verifier(run, options, progress).verify();
}

std::map<std::string, std::string> record_again(const Run& run, const std::vector<std::string>& keys,
                                                const std::string& folder, const VerifyOptions& options,
                                                Progress& progress) {
  return Verifier(run, options, progress).record(keys, folder);
}

std::string other_machine_sentence(const nlohmann::json& environment, const std::string& here) {
  const std::string there = environment.value("machine", "");
  if (there.empty() || there == here) return "";
  return fmt::format(
      "the rows were made on another machine ({}; this one: {}): networks sum in the order of its vector instructions, "
      "and a contact amplifies the last bits",
      there, here);
}

}  // namespace duet
