// Episodes of a suite that their caller leads, plan by plan: what an environment of reinforcement learning is made of.
// Loop, scoring and row are those of `duet run`.
#pragma once

#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include "duet/execution/experiment.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/work/run_work.h"
#include "duet/policies/plan_queue.h"

namespace duet {

// Which part of a suite; what is empty is the first that the suite has, of engines the first that this machine has too.
struct SteppedPart {
  std::string engine = {}, controller = {}, task = {}, perturbation = {};
};

// The name that the caller has among a suite's policies.
inline constexpr const char* kCaller = "caller";

// The experiment that such episodes are drawn from; its policy is the caller. Throws std::invalid_argument for a name
// that the suite does not have, MissingError for an engine or a controller that this machine lacks, InputError (clips,
// cards, a suite of walking commands).
std::shared_ptr<Experiment> stepped_experiment(Suite suite, const SteppedPart& part, int threads, Progress& progress);

// How many questions an episode asks at most.
int questions_of(const Experiment& experiment, std::int64_t episode);

// The bodies that are led: the robot alone, while the partner follows the clip, or both.
enum class DrivenBodies { kRobot, kBoth };

// One episode at a time, on a thread of its own. One owner, not thread-safe. A forked child has no such thread: there
// every call throws std::runtime_error, and nothing is waited for.
class SteppedEpisode {
 public:
  explicit SteppedEpisode(std::shared_ptr<const Experiment> experiment, DrivenBodies led = DrivenBodies::kRobot)
      : experiment_(std::move(experiment)), led_(led), process_(::getpid()) {}
  ~SteppedEpisode();
  SteppedEpisode(const SteppedEpisode&) = delete;
  SteppedEpisode& operator=(const SteppedEpisode&) = delete;

  // Begins an episode of the suite and ends the one before. The first question; null where it ended without one.
  // Throws std::invalid_argument for a number that is not in [0, size).
  std::shared_ptr<const PlanRequest> begin(int episode) {
    start(episode);
    return next();
  }
  // Answers the last question (PlanQueue::answer). The next one; null: the episode is over. Throws
  // std::invalid_argument where it is over already, and for a plan of another shape.
  std::shared_ptr<const PlanRequest> go_on(std::span<const double> numbers, int rows) {
    answer(numbers, rows);
    return next();
  }
  // The same in two halves, so that many episodes compute at once.
  void start(int episode);
  void answer(std::span<const double> numbers, int rows);
  // Throws std::invalid_argument before the first start().
  std::shared_ptr<const PlanRequest> next();
  // Where the partner is to be at the ticks up to the next question, where both are led and the episode is not over: at
  // first as in the clip, then as it was led. It has kTicksPerPlan frames; past the episode's end the last one stands.
  [[nodiscard]] PointTracks partner_ahead() const;
  // Changes it; before the answer. Throws std::invalid_argument for other sizes and for numbers that are not finite.
  void lead_partner(const PointTracks& ahead);
  [[nodiscard]] bool is_over() const { return question_ == nullptr; }
  // The row of the episode that is over; none before the first one was and of one that was stopped.
  [[nodiscard]] const std::optional<EpisodeRow>& row() const { return row_; }
  // Ends it, and there is no row.
  void stop();

 private:
  void require_same_process() const;

  std::shared_ptr<const Experiment> experiment_;  // shared by the episodes of a batch
  DrivenBodies led_;
  pid_t process_;
  std::shared_ptr<PointTracks> partner_;         // with the episode's thread, which waits while a question is open
  std::shared_ptr<PlanQueue> queue_;             // with the episode's thread
  std::shared_ptr<const PlanRequest> question_;  // that waits for its answer
  std::optional<EpisodeRow> row_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace duet
