// A suite that is set up on this machine: what it says, its identity, the robots, controllers and policies that were
// loaded for it, and the plan of its episodes. All episodes run here: `duet run`, the workers of a
// cluster, `duet verify`, Python, and a robot behind its guard.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/rollout/act_episode.h"
#include "duet/rows/episode_row.h"
#include "duet/scoring/scoring.h"

namespace duet {

std::string utc_now();  // "2026-11-23T15:00:00Z"

// The row of an episode that did not run to an end of its own, with what happened in the place of its results.
EpisodeRow ended_row(EpisodeRow row, Outcome outcome, const std::string& message);

struct ExperimentOptions {
  EpisodeFilter part = {};  // the episodes of the plan
  // Those that are not loaded.
  std::vector<std::string> skipped_controllers = {}, skipped_policies = {};
  std::map<std::string, PolicyLoader> called = {};  // how policies are made that the caller brings, by name
  std::vector<std::string> led = {};                // policies that the caller is: nobody knows what they are
};
// Leaves out of loading what the suite has beside `chosen`.
ExperimentOptions only(const EpisodeFilter& chosen, const Suite& suite);

// The differences of a run of an episode from its spec.
struct EpisodeOverrides {
  PolicyMaker policy = {};                // leads in the place of the suite's own
  std::function<bool()> stop_asked = {};  // empty: signals alone stop it
  // Filled with what the clip's partner does; the policy may then change what comes after the tick that it plans at
  // (Episode::driven_partner). Null: the partner follows the clip.
  std::shared_ptr<PointTracks> partner = {};
  std::string trajectories = {};  // the folder for recordings that the suite keeps; empty: none is kept
  bool record_all = false;        // every recording is kept, whatever the suite says
  std::string engine = {};        // in the row, of another world than an engine: "twin"
  // The episode in that world; the suite scores what comes back.
  std::function<Rollout(const RolloutSetup& setup, Policy& policy)> world = {};
};

class Experiment {
 public:
  // Throws as Bodies and identity_of.
  explicit Experiment(Suite suite, ExperimentOptions options = {});
  Experiment(const Experiment&) = delete;  // the specs point into it
  Experiment& operator=(const Experiment&) = delete;

  [[nodiscard]] const Suite& suite() const { return suite_; }
  [[nodiscard]] const RunIdentity& identity() const { return identity_; }
  [[nodiscard]] const Embodiments& bodies() const { return bodies_; }

  // Makes the clips ready, puts them on every robot and plans. Throws as prepare_clips and EpisodePlan.
  void prepare(int threads, Progress& progress, PrepareOptions options = {});
  // The same with clips that are ready, retargeted to bodies().nominal(). Specs from before point to nothing.
  void take_clips(std::vector<PairedMotion> clips);

  // The plan, and what follows; throw std::logic_error before there are clips.
  [[nodiscard]] const EpisodePlan& plan() const;
  [[nodiscard]] std::int64_t size() const { return plan().size(); }
  [[nodiscard]] EpisodeSpec at(std::int64_t i) const { return plan().at(i); }

  // A row with everything that is known before the episode runs, its key included.
  [[nodiscard]] EpisodeRow row(std::int64_t i) const { return row(at(i)); }
  [[nodiscard]] EpisodeRow row(const EpisodeSpec& spec) const;
  // Why this machine lacks the episode's controller or policy; empty where it has both.
  [[nodiscard]] static std::string lack_of(const EpisodeSpec& spec);
  // A new controller of the episode. Throws std::invalid_argument for one that was left out.
  [[nodiscard]] static std::unique_ptr<Controller> controller(const EpisodeSpec& spec);
  // The scene with the perturbation's ground and robot, and the setup of an episode that a clip leads.
  [[nodiscard]] Scene scene(const EpisodeSpec& spec) const;
  [[nodiscard]] RolloutSetup setup(const EpisodeSpec& spec) const;

  // Runs the episode and scores it. Whatever ends it is an outcome of its row: `unsupported` for what this machine
  // lacks, `error` for an exception. Throws StorageError (a full disk) and std::bad_alloc, which say nothing of the
  // episode, and EpisodeInterrupted for one that was stopped. Thread-safe.
  [[nodiscard]] EpisodeRow run(std::int64_t i, const EpisodeOverrides& overrides = {}) const {
    return run(at(i), overrides);
  }
  [[nodiscard]] EpisodeRow run(const EpisodeSpec& spec, const EpisodeOverrides& overrides = {}) const;

 private:
  [[nodiscard]] EpisodeConditions conditions(const EpisodeSpec& spec, const Pose& start) const;
  void draw_clear_start(const EpisodeSpec& spec, const AdaptationOptions& options, RolloutSetup& setup) const;
  [[nodiscard]] bool keeps(const EpisodeRow& row, const EpisodeOverrides& overrides) const;
  template <typename Setup, typename Leader>
  Rollout executed(const EpisodeSpec& spec, const Setup& setup, Leader& leader, EpisodeRow& row) const;
  void simulate_walk(const EpisodeSpec& spec, const EpisodeOverrides& overrides, EpisodeRow& row) const;
  void simulate(const EpisodeSpec& spec, const EpisodeOverrides& overrides, EpisodeRow& row) const;

  Suite suite_;
  EpisodeFilter part_;
  Embodiments bodies_;
  RunIdentity identity_;
  ScoringRules rules_;
  std::optional<EpisodePlan> plan_;
};

}  // namespace duet
