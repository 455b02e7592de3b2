// Policies that one caller answers for all episodes at once: each episode, on a thread of its own, asks for a plan and
// waits; the caller takes everything that waits as one batch. Nothing here knows what the caller is (a function of
// another language, a network at batch B, somebody who steps an environment). Thread-safe; one caller at a time.
#pragma once

#include <Eigen/Core>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "duet/policies/policy.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The question of an episode; it owns its numbers, as the episode may have given up before they are read.
struct PlanRequest {
  std::int64_t episode = 0;  // counts the episodes of a queue, by their first question: tells apart those under way
  int tick = 0;              // 50 Hz ticks since the episode's start
  bool first = false;        // of its episode
  Task task = Task::kHug;
  std::string prompt = {};
  std::uint64_t seed = 0;
  Eigen::MatrixXd frames = {};  // to_matrix of the observation: a column per frame, (149, 12) for 29 joints
  Pose start = {}, now = {};    // X_WB at the episode's start and at `tick`
  Pose standing = {};           // where the robot would stand in its neutral pose at the start: the null arm's
};

// The numbers of a plan: `rows` of 7 + joints each: root position [m], its quaternion wxyz, joints [rad], frame W.
// kAnchors rows are anchors (densify), kDensePlan rows are references at 50 Hz.
inline constexpr int kDensePlan = (kAnchors - 1) * kTicksPerAnchor;

struct PlanQueueOptions {
  std::string name = "queue";  // of the policy, in messages
  double patience = 0.0;       // of the caller with one batch [s]; then those that wait for it are dead; 0: for ever
  double share = 0.5;          // of the episodes under way that take() waits for, in (0, 1]
};

class PlanQueue : public std::enable_shared_from_this<PlanQueue> {
 public:
  // Throws std::invalid_argument for options out of range.
  static std::shared_ptr<PlanQueue> make(PlanQueueOptions options);

  // Makes policies of episodes that ask here. All have the joints of the first robot: throws std::invalid_argument for
  // one of other joints.
  PolicyMaker maker(std::shared_ptr<const RobotModel> robot);
  // The model of the robot; null before maker().
  [[nodiscard]] std::shared_ptr<const RobotModel> robot() const;

  // Waits until `share` of the episodes under way ask, or for `seconds`; returns those that ask, by episode. None:
  // nobody asked in that time, or the queue is closed.
  std::vector<std::shared_ptr<const PlanRequest>> take(double seconds);
  // One of those that were taken. `numbers`: row by row. A plan that is not finite, or whose quaternion is shorter than
  // 1e-3, is left out and counted as invalid; joints are clamped to their limits, quaternions made unit. Throws
  // std::invalid_argument for another number of rows or numbers. Without effect where the episode has given up.
  void answer(const PlanRequest& request, std::span<const double> numbers, int rows);
  // The episode ends as an error with this sentence.
  void refuse(const PlanRequest& request, const std::string& why);
  // Ends the answers: episodes that ask, now and later, end with this sentence.
  void close(const std::string& why);
  [[nodiscard]] bool closed() const;

 private:
  friend class QueuedPolicy;
  struct Place;  // of a request, and of its answer
  using Clock = std::chrono::steady_clock;

  explicit PlanQueue(PlanQueueOptions options) : options_(std::move(options)) {}
  void join();
  void leave();
  [[nodiscard]] std::int64_t next_episode();
  // Waits for the answer to `place`; false where the episode was asked to stop.
  bool ask(const std::shared_ptr<Place>& place, const std::function<bool()>& stop_asked);
  [[nodiscard]] bool enough() const;
  [[nodiscard]] bool out_of_patience(const Place& place) const;
  void settle(const PlanRequest& request, const std::function<void(Place&)>& how);

  PlanQueueOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;                       // for the caller
  std::shared_ptr<const RobotModel> robot_;               // shared with the policies
  std::deque<std::shared_ptr<Place>> waiting_, in_work_;  // asked; taken and not answered yet
  Clock::time_point taken_at_;                            // when those in work were
  int under_way_ = 0;                                     // policies that live
  std::int64_t episodes_ = 0;
  bool closed_ = false;
  std::string why_;
};

}  // namespace duet
