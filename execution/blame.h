// Whose failure is it: a failed episode is taken up again in every engine, from the states that it had before it
// failed, jittered, under the same policy and controller. A failure that comes back in all of them is the policy's (or
// the controller's, which is the same everywhere); one that stays in a single engine is that engine's.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/engine_module.h"
#include "duet/execution/experiment.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/work/run_work.h"
#include "duet/policies/policy.h"

namespace duet {

struct BlameOptions {
  std::vector<std::string> engines = {};  // to restart in, beside the episode's own; none: all that are there
  // How long before the failure the restarts begin [s]; the start of the episode is always one.
  std::vector<double> before = {2.0, 1.5, 1.0, 0.7, 0.5, 0.3, 0.2, 0.1};
  int jitters = 5;  // restarts in each engine from each state
  std::uint64_t seed = 1;
  int threads = 1;
  std::function<std::unique_ptr<Backend>(const std::string& engine, const Scene& scene)> make_engine = make_backend;
  PolicyMaker policy = {};  // leads in the place of the episode's own
};

// The spread of a jitter: of the base's velocity [m/s] and rate of turn [rad/s] on each axis, of each joint's velocity
// [rad/s]. Poses stay as they were, since an engine refuses links that it would have to push apart.
struct RestartJitter {
  static constexpr double kSpeed = 0.02, kTurn = 0.05, kJoint = 0.05;
};

// Restarts of one engine from one state.
struct Restarts {
  int failed = 0, ran = 0;   // that ended without success, of those that began
  std::string refusal = {};  // why others did not begin
  [[nodiscard]] double share() const {
    return ran == 0 ? std::numeric_limits<double>::quiet_NaN() : static_cast<double>(failed) / ran;
  }
};

struct RestartInstant {
  int tick = 0;
  std::map<std::string, Restarts> engines;
  [[nodiscard]] double seconds() const { return tick / 50.0; }
};

enum class Culprit {
  kNobody,  // the episode succeeds
  kSolver,  // it fails again in its own engine, and not in the others
  kPolicy,  // it fails in the other engines, too
  kUnclear  // it does not come back from jittered states, or in some of the other engines
};
std::string_view to_string(Culprit culprit);

// The first quantity in which the episode's own engine leaves what all others do from the same state.
struct FirstDivergence {
  std::string quantity;             // "root height", "left_knee_joint", "contact force", "plan"; "" where none does
  double seconds = 0.0;             // of the episode
  double own = 0.0, nearest = 0.0;  // there, and in the nearest other engine
  std::string unit;
};

struct Blame {
  EpisodeRow row;  // as it ran now
  Culprit culprit = Culprit::kNobody;
  double failure = 0.0;                  // when it failed: of a fall its time, else the end of the act [s]
  std::vector<RestartInstant> instants;  // from the start of the episode on
  // From here on it fails in every engine; NaN: nowhere. [s]
  double all_fail_from = std::numeric_limits<double>::quiet_NaN();
  FirstDivergence divergence;
};

// Engines in which a share of restarts fails: at most kRarely of them, at least kMostly.
inline constexpr double kRarely = 1.0 / 3.0, kMostly = 2.0 / 3.0;
inline constexpr double kChance = 0.02;  // p below which one engine fails more often than the others

// Whose the failure is, by what the restarts say; `own` is the engine of the episode. The policy's where the others
// fail from the start of the episode. The solver's where, from the earliest state from which it comes back in `own`,
// the others do not fail; or where it fails in `own` more often than in the others, over all states from which those
// can still succeed, by Fisher's exact test.
Culprit culprit_of(const std::vector<RestartInstant>& instants, const std::string& own);

// Runs the episode, and where it fails its restarts. Throws std::invalid_argument for an episode of playback or of a
// walking command, for an engine that is not there and where there is no other than its own.
Blame blame_episode(const Experiment& experiment, const EpisodeSpec& spec, const BlameOptions& options,
                    Progress& progress);

// Two recordings from the same state on (`tick` of both), where they first differ from each other; `others` has at
// least one. Thresholds: docs/moving-between-engines.md, "Whose failure is it".
FirstDivergence first_divergence(const Recording& own, const std::vector<Recording>& others, const RobotModel& robot,
                                 int tick);

// Sentences for people.
std::string blame_text(const Blame& blame);
nlohmann::json blame_json(const Blame& blame);

}  // namespace duet
