// Whether the rows of a run are what its suite makes: each must be an episode of the suite's plan, none may be left
// out, none may be marked as not supported that this machine runs, and episodes that are run again must give the same
// row, field by field. Its limits: docs/trust.md, "What verify cannot tell".
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/execution/experiment.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/work/run_work.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/row_file.h"

namespace duet {

struct VerifyOptions {
  int episodes = 5;  // run again, drawn at random
  bool all = false;  // run all again; else, beside those drawn, as many of the rows that timed out
  std::uint64_t seed = 1;
  int threads = 1;
  bool allow_programs = false;  // Suite::allow_programs
  std::string clips = {};       // a folder or file with the clips that the run does not keep
};

struct RepeatedEpisode {
  EpisodeRow row;                            // as stored
  std::string state_hash;                    // now
  std::vector<FieldDifference> differences;  // first: stored, second: now
  // Where it timed out there or here: in both, no field is compared; in one of them, how it ended in the other is a
  // difference that a slow or busy machine makes, too: "timed out there, ends here in 1.2 s".
  std::string time_out = "";
};

struct Verification {
  std::vector<std::string> faults;       // of rows that are not what the suite plans; sentences
  std::vector<std::string> missing;      // of episodes that are not there; sentences
  std::vector<std::string> not_asked;    // of episodes of the suite that run.json says nobody asked for; sentences
  std::vector<RepeatedEpisode> repeats;  // in the order of the run's rows
  int repeatable = 0;                    // rows that this machine can run
  std::map<std::string, int> not_run;    // why -> rows that need what this machine lacks
  std::int64_t asked = 0, episodes = 0;  // of the suite: those that were asked for, all
  // Repeats that differ; those that timed out there or here and ended in the other are counted apart.
  [[nodiscard]] int different() const;
  [[nodiscard]] int timed_out() const;
  [[nodiscard]] int rows_not_run() const;
};

// Sentences for rows that differ: that they were made on another machine, or by a program of another commit, than
// `here` (both as capture_environment() has them); "" where neither, or where the run does not say.
std::string other_maker_sentences(const nlohmann::json& there, const nlohmann::json& here);

// Throws InputError where the run's inputs, suite, detectors, policies or controllers are not what run.json says or not
// what this machine has (which, expected, found), MissingError for a network that is not there.
Verification verify_run(const Run& run, const VerifyOptions& options, Progress& progress);

// Runs these episodes of the run again and keeps their recordings in `folder`, as `record.trajectories` does; the hash
// of their states by key. Throws as verify_run, and MissingError for an episode that this machine cannot run,
// InputError for one that its suite does not plan.
std::map<std::string, std::string> record_again(const Run& run, const std::vector<std::string>& keys,
                                                const std::string& folder, const VerifyOptions& options,
                                                Progress& progress);

// Sets the run up again and gives `use` the experiment with one of its episodes. Throws as record_again.
void with_episode(const Run& run, const std::string& key, const VerifyOptions& options, Progress& progress,
                  const std::function<void(const Experiment& experiment, const EpisodeSpec& spec)>& use);

}  // namespace duet
