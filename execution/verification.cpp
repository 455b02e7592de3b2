#include "duet/execution/verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <unordered_map>

#include "duet/core/machine.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/execution/run_inputs.h"
#include "duet/execution/runner.h"
#include "duet/metrics/detector.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/folder/run_info.h"

namespace duet {
namespace {

// A block of rows, which filters take or leave as a whole.
using Block = std::tuple<std::string, std::string, std::string, std::string, std::string>;

Block block_of(const EpisodeRow& row) { return {row.engine, row.controller, row.policy, row.perturbation, row.task}; }

std::string text_of(const Block& block) {
  const auto& [engine, controller, policy, perturbation, task] = block;
  return fmt::format("{} of {}/{}/{} {}", task, engine, controller, policy, perturbation);
}

std::string text_of(const EpisodeRow& row) {
  return fmt::format("{} {} of {}/{}/{} {} ({} arm)", row.clip, row.episode, row.engine, row.controller, row.policy,
                     row.perturbation, row.arm);
}

// Names of the suite that no row has.
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
  Verifier(const Verifier&) = delete;  // the plan points into the experiment
  Verifier& operator=(const Verifier&) = delete;
  Verifier(const Run& run, const VerifyOptions& options, Progress& progress)
      : run_(run), options_(options), progress_(progress), loaded_(what_is_needed()), experiment_(suite(), loaded_) {
    check_identity();
    experiment_.prepare(options_.threads, progress_);
    for (std::int64_t i = 0; i < experiment_.size(); ++i) {
      plan_.push_back(experiment_.at(i));
      planned_.push_back(experiment_.row(plan_.back()));
      place_[planned_.back().key] = static_cast<std::size_t>(i);
    }
  }

  Verification verify() {
    for (const EpisodeRow& row : run_.rows) check_row(row);
    check_missing();
    check_unsupported();
    repeat();
    return std::move(result_);
  }

  std::map<std::string, std::string> record(const std::vector<std::string>& keys, const std::string& folder) {
    std::vector<std::string> hashes(keys.size());
    progress_.start("running again", static_cast<int>(keys.size()), "episodes");
    parallel_for_each(static_cast<int>(keys.size()), options_.threads, [&](int i) {
      hashes[i] = experiment_.run(spec_of(keys[i]), {.trajectories = folder, .record_all = true}).state_hash;
      progress_.advance();
    });
    progress_.finish();
    std::map<std::string, std::string> by_key;
    for (std::size_t i = 0; i < keys.size(); ++i) by_key[keys[i]] = hashes[i];
    return by_key;
  }

  // Throws InputError for an episode that the suite does not plan, MissingError for one that cannot run here.
  [[nodiscard]] const EpisodeSpec& spec_of(const std::string& key) const {
    const auto place = place_.find(key);
    if (place == place_.end())
      throw InputError(fmt::format("'{}': episode {:.16} is no episode of its suite", run_.path, key));
    const EpisodeSpec& spec = plan_[place->second];
    if (const std::string lack = lack_of(spec); !lack.empty()) throw MissingError(lack);
    return spec;
  }
  [[nodiscard]] const Experiment& experiment() const { return experiment_; }

 private:
  // Actors that no row has need not be on this machine.
  [[nodiscard]] ExperimentOptions what_is_needed() const {
    const Suite named = parse_run_suite(run_.info.suite_yaml, run_.path + "/suite.yaml");
    return {.skipped_controllers = without_rows(run_, named.controller_names(), &EpisodeRow::controller),
            .skipped_policies = without_rows(run_, named.policy_names(), &EpisodeRow::policy)};
  }

  [[nodiscard]] Suite suite() const {
    Suite suite = suite_of_run(run_, {loaded_.skipped_policies, loaded_.skipped_controllers, options_.clips});
    suite.allow_programs = options_.allow_programs;
    return suite;
  }

  void check_identity() const {
    for (const EpisodeRow& row : run_.rows)
      if (row.detectors != kDetectorsVersion)
        throw InputError(fmt::format("'{}': its rows were judged by detectors {}, this program has {}", run_.path,
                                     row.detectors, kDetectorsVersion));
    const RunIdentity& identity = experiment_.identity();
    if (identity.suite_hash != run_.info.suite_hash)
      throw InputError(fmt::format(
          "'{}': suite.yaml, with its inputs and this program's robots and limits, has the hash {}, run.json says {}",
          run_.path, short_digest(identity.suite_hash), short_digest(run_.info.suite_hash)));
    check_actors("policy", run_.info.policies, identity.policies, loaded_.skipped_policies);
    check_actors("controller", run_.info.controllers, identity.controllers, loaded_.skipped_controllers);
  }

  // Checks what is known of an episode before it runs.
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

  // Notes as missing what run.json says was asked for; notes apart what it says that nobody asked for.
  void check_missing() {
    std::set<std::string> keys;
    for (const EpisodeRow& row : run_.rows) keys.insert(row.key);
    std::map<Block, std::pair<int, int>> missing, not_asked;  // how many, of how many
    for (std::size_t i = 0; i < plan_.size(); ++i) {
      const bool wanted = is_wanted(plan_[i]), there = keys.contains(planned_[i].key);
      result_.asked += wanted ? 1 : 0;
      auto& [count, all] = (wanted ? missing : not_asked)[block_of(planned_[i])];
      ++all;
      count += there ? 0 : 1;
    }
    result_.episodes = std::ssize(plan_);
    result_.missing = sentences(missing, "are not in the run");
    result_.not_asked = sentences(not_asked, "were not asked for, as run.json says");
  }

  static std::vector<std::string> sentences(const std::map<Block, std::pair<int, int>>& counts, const char* what) {
    std::vector<std::string> sentences;
    for (const auto& [block, count] : counts)
      if (count.first > 0)
        sentences.push_back(fmt::format("{}: {} of {} episodes {}", text_of(block), count.first, count.second, what));
    return sentences;
  }

  // A run that does not say what was asked for is held against the whole suite: else who leaves rows out would leave
  // that out, too.
  [[nodiscard]] bool is_wanted(const EpisodeSpec& spec) const {
    return !run_.info.plan || std::ranges::any_of(run_.info.plan->parts, [&](const EpisodeFilter& part) {
      return belongs(spec, spec.clip->task, part);
    });
  }

  // Why this machine cannot run the episode; empty where it can.
  [[nodiscard]] static std::string lack_of(const EpisodeSpec& spec) {
    if (!can_run_in(spec.engine)) return fmt::format("engine '{}' is not on this machine", spec.engine);
    return Experiment::lack_of(spec);
  }

  [[nodiscard]] const EpisodeSpec& spec_of(const EpisodeRow& row) const { return plan_[place_.at(row.key)]; }

  // An episode that has nothing to say against its engine, controller and policy is set up here and stopped at once:
  // what refuses it there would refuse it here.
  [[nodiscard]] bool is_refused_here(const EpisodeRow& row) const {
    try {
      return experiment_.run(spec_of(row), {.stop_asked = [] { return true; }}).outcome == Outcome::kUnsupported;
    } catch (const EpisodeInterrupted&) {
      return false;
    }
  }

  // A row that says so takes an episode out of the count: it must be so here, too, where this machine has all of it.
  void check_unsupported() {
    std::vector<const EpisodeRow*> marked;
    for (const EpisodeRow& row : run_.rows)
      if (row.outcome == Outcome::kUnsupported && place_.contains(row.key) && lack_of(spec_of(row)).empty())
        marked.push_back(&row);
    std::vector<char> refused(marked.size());
    parallel_for_each(static_cast<int>(marked.size()), options_.threads,
                      [&](int i) { refused[i] = is_refused_here(*marked[i]) ? 1 : 0; });
    for (std::size_t i = 0; i < marked.size(); ++i)
      if (refused[i] == 0)
        result_.faults.push_back(fmt::format("{}: is marked as unsupported ({}), and this machine runs it",
                                             text_of(*marked[i]), excerpt(marked[i]->message)));
  }

  // Some of them, without replacement, from a seeded shuffle.
  void draw(std::vector<const EpisodeRow*>& rows, const char* stream) const {
    if (options_.all) return;
    Random random(options_.seed, stream_key({stream}));
    for (std::size_t i = 0; i + 1 < rows.size(); ++i)
      std::swap(rows[i], rows[i + static_cast<std::size_t>(random.below(static_cast<int>(rows.size() - i)))]);
    rows.resize(std::min(rows.size(), static_cast<std::size_t>(options_.episodes)));
  }

  // In the order of the run. Rows that timed out are drawn apart: they are few, and the ones to look at.
  std::vector<const EpisodeRow*> sample() {
    std::vector<const EpisodeRow*> rows, time_outs;
    for (const EpisodeRow& row : run_.rows) {
      if (!place_.contains(row.key)) continue;
      if (const std::string lack = lack_of(spec_of(row)); !lack.empty()) {
        ++result_.not_run[lack];
      } else if (row.outcome != Outcome::kUnsupported) {  // check_unsupported
        (row.outcome == Outcome::kTimedOut ? time_outs : rows).push_back(&row);
      }
    }
    result_.repeatable = static_cast<int>(rows.size() + time_outs.size());
    draw(rows, "verify");
    draw(time_outs, "verify time-outs");
    rows.insert(rows.end(), time_outs.begin(), time_outs.end());
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
    EpisodeRow now = experiment_.run(spec_of(row));
    if (!with_traces) {
      now.trace = {};
      now.feet = {};
    }
    const bool there = row.outcome == Outcome::kTimedOut, here = now.outcome == Outcome::kTimedOut;
    if (there && here) return {row, now.state_hash, {}, "timed out there and here"};
    RepeatedEpisode repeat{row, now.state_hash, row_differences(row, now)};
    if (there)
      repeat.time_out = fmt::format("timed out there, ends here in {:.1f} s ({})", now.wall_s, to_string(now.outcome));
    if (here) repeat.time_out = fmt::format("ended there in {:.1f} s, times out here", row.wall_s);
    return repeat;
  }

  const Run& run_;
  const VerifyOptions& options_;
  Progress& progress_;
  ExperimentOptions loaded_;
  Experiment experiment_;
  std::vector<EpisodeSpec> plan_;
  std::vector<EpisodeRow> planned_;                     // as known before they run
  std::unordered_map<std::string, std::size_t> place_;  // of a key in both
  Verification result_;
};

}  // namespace

int Verification::different() const {
  return static_cast<int>(std::ranges::count_if(
      repeats, [](const RepeatedEpisode& repeat) { return !repeat.differences.empty() && repeat.time_out.empty(); }));
}

int Verification::timed_out() const {
  return static_cast<int>(std::ranges::count_if(
      repeats, [](const RepeatedEpisode& repeat) { return !repeat.differences.empty() && !repeat.time_out.empty(); }));
}

int Verification::rows_not_run() const {
  int rows = 0;
  for (const auto& [why, count] : not_run) rows += count;
  return rows;
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

void with_episode(const Run& run, const std::string& key, const VerifyOptions& options, Progress& progress,
                  const std::function<void(const Experiment& experiment, const EpisodeSpec& spec)>& use) {
  const Verifier verifier(run, options, progress);
  use(verifier.experiment(), verifier.spec_of(key));
}

std::string other_maker_sentences(const nlohmann::json& there, const nlohmann::json& here) {
  const auto differs = [&](const char* key) {
    const nlohmann::json::json_pointer at(key);
    const std::string theirs = there.value(at, ""), ours = here.value(at, "");
    return !theirs.empty() && theirs != ours ? std::pair(theirs, ours) : std::pair<std::string, std::string>();
  };
  std::string text;
  if (const auto machines = differs("/machine"); !machines.first.empty())
    text += fmt::format(
        "the rows were made on another machine ({}; this one: {}); processors with AVX2 and fused multiply-add give "
        "the "
        "same bits: compare the compiler and the libraries in the run's env.json with `duet doctor`",
        machines.first, machines.second);
  if (const auto commits = differs("/build/commit"); !commits.first.empty())
    text += fmt::format("{}the rows were made by the program of commit {:.12}, this one is of {:.12}",
                        text.empty() ? "" : "\n", commits.first, commits.second);
  return text;
}

}  // namespace duet
