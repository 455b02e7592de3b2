#include "duet/policies/plan_queue.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "duet/core/require.h"
#include "duet/policies/policy.h"
#include "duet/policies/scheduler.h"

namespace duet {
namespace {

constexpr std::chrono::milliseconds kLookAround(50);  // between two looks at whether an episode is to stop
constexpr double kShortestQuaternion = 1e-3;          // norm; below it the direction is noise
constexpr double kUnitEnough = 1e-12;                 // nearer to 1 is taken as it is, to the bit
constexpr int kBeforeJoints = 7;

// "" where the numbers are a plan.
std::string fault_of_plan(std::span<const double> numbers, int rows) {
  const std::size_t width = numbers.size() / rows;
  for (std::size_t i = 0; i < numbers.size(); ++i)
    if (!std::isfinite(numbers[i]))
      return fmt::format("plan: row {}, number {}: expected a finite number, found {}", i / width, i % width,
                         numbers[i]);
  for (int row = 0; row < rows; ++row) {
    const Eigen::Map<const Eigen::Vector4d> wxyz(&numbers[row * width + 3]);
    if (!(wxyz.norm() >= kShortestQuaternion))
      return fmt::format("plan: row {}: expected a unit quaternion, found one of length {}", row, wxyz.norm());
  }
  return "";
}

Reference reference_of(std::span<const double> row, const RobotModel& robot) {
  Eigen::Vector4d wxyz(row[3], row[4], row[5], row[6]);
  if (std::abs(wxyz.norm() - 1.0) > kUnitEnough) wxyz.normalize();
  Reference reference{{{wxyz[0], wxyz[1], wxyz[2], wxyz[3]}, {row[0], row[1], row[2]}}, Eigen::VectorXd(robot.dof())};
  for (int j = 0; j < robot.dof(); ++j)
    reference.q[j] = std::clamp(row[kBeforeJoints + j], robot.joints[j].lower, robot.joints[j].upper);
  return reference;
}

std::vector<Reference> references_of(std::span<const double> numbers, int rows, const RobotModel& robot) {
  std::vector<Reference> references;
  const std::size_t width = numbers.size() / rows;
  for (int row = 0; row < rows; ++row) references.push_back(reference_of(numbers.subspan(row * width, width), robot));
  if (rows != kAnchors) return references;
  Anchors anchors;
  std::ranges::move(references, anchors.begin());
  return densify(anchors);
}

}  // namespace

struct PlanQueue::Place {
  enum class State { kWaiting, kPlanned, kInvalid, kRefused };
  PlanRequest request;
  State state = State::kWaiting;
  std::vector<Reference> plan;
  std::string message;
  std::condition_variable settled;
};

// An episode's end of the queue.
class QueuedPolicy final : public Policy {
 public:
  QueuedPolicy(std::shared_ptr<PlanQueue> queue, std::shared_ptr<const RobotModel> robot)
      : queue_(std::move(queue)), robot_(std::move(robot)) {
    queue_->join();
  }
  ~QueuedPolicy() override { queue_->leave(); }
  QueuedPolicy(const QueuedPolicy&) = delete;
  QueuedPolicy& operator=(const QueuedPolicy&) = delete;

  [[nodiscard]] std::string_view name() const override { return queue_->options_.name; }
  [[nodiscard]] PolicyFaults faults() const override { return faults_; }

  void reset(const EpisodeContext& context) override {
    context_ = context;
    faults_ = {};
    episode_ = -1;
    held_ = {context.start.X_WB, context.start.q};
  }

  // Where there is no plan: the pose of the last one, at first that of the start.
  Anchors act(const Observation& observation) override {
    const std::vector<Reference> references = plan(observation);
    Anchors anchors;
    for (int i = 0; i < kAnchors; ++i)
      anchors[i] = references.empty() ? held_ : references[std::min<std::size_t>(i * kTicksPerAnchor, kDensePlan - 1)];
    return anchors;
  }

  std::vector<Reference> plan(const Observation& observation) override {
    if (faults_.dead) return {};
    if (!is_finite(observation))
      return leave_out(faults_, name(), observation.tick, "observation: expected finite numbers, found others");
    const auto place = std::make_shared<PlanQueue::Place>();
    place->request = request_of(observation);
    if (!queue_->ask(place, context_.stop_asked)) return {};
    if (place->state == PlanQueue::Place::State::kInvalid)
      return leave_out(faults_, name(), observation.tick, place->message);
    if (place->state == PlanQueue::Place::State::kRefused) {
      faults_.dead = true;
      faults_.message = fmt::format("policy '{}': tick {}: {}", name(), observation.tick, place->message);
      return {};
    }
    held_ = place->plan.front();
    return std::move(place->plan);
  }

 private:
  PlanRequest request_of(const Observation& observation) {
    const bool first = episode_ < 0;
    if (first) episode_ = queue_->next_episode();
    return {.episode = episode_,
            .tick = observation.tick,
            .first = first,
            .task = context_.task,
            .prompt = context_.prompt,
            .seed = context_.seed,
            .frames = to_matrix(observation, context_.start.X_WB.p),
            .start = context_.start.X_WB,
            .now = observation.now().robot.X_WB,
            .standing = robot_->standing_state(context_.start.X_WB).X_WB};
  }

  std::shared_ptr<PlanQueue> queue_;         // outlives the caller's hold of it
  std::shared_ptr<const RobotModel> robot_;  // shared by the episodes of a run
  EpisodeContext context_;
  PolicyFaults faults_;
  Reference held_;
  std::int64_t episode_ = -1;  // none before its first question
};

std::shared_ptr<PlanQueue> PlanQueue::make(PlanQueueOptions options) {
  require(options.patience >= 0.0 && std::isfinite(options.patience),
          "plan queue: patience: expected 0 s or more, found {}", options.patience);
  require(options.share > 0.0 && options.share <= 1.0, "plan queue: share: expected a number in (0, 1], found {}",
          options.share);
  return std::shared_ptr<PlanQueue>(new PlanQueue(std::move(options)));
}

PolicyMaker PlanQueue::maker(std::shared_ptr<const RobotModel> robot) {
  require(robot != nullptr, "policy '{}' needs a robot", options_.name);
  const std::lock_guard lock(mutex_);
  if (!robot_) robot_ = robot;
  require(robot->joint_names() == robot_->joint_names(),
          "policy '{}': expected the joints of robot '{}', found those of '{}'", options_.name, robot_->name,
          robot->name);
  return
      [queue = shared_from_this(), robot = std::move(robot)] { return std::make_unique<QueuedPolicy>(queue, robot); };
}

std::shared_ptr<const RobotModel> PlanQueue::robot() const {
  const std::lock_guard lock(mutex_);
  return robot_;
}

void PlanQueue::join() {
  const std::lock_guard lock(mutex_);
  ++under_way_;
}

void PlanQueue::leave() {
  const std::lock_guard lock(mutex_);
  --under_way_;
  changed_.notify_all();
}

std::int64_t PlanQueue::next_episode() {
  const std::lock_guard lock(mutex_);
  return episodes_++;
}

bool PlanQueue::enough() const {
  return !waiting_.empty() && static_cast<double>(waiting_.size()) >= options_.share * under_way_;
}

bool PlanQueue::out_of_patience(const Place& place) const {
  if (options_.patience <= 0.0 || in_work_.empty() || place.state != Place::State::kWaiting) return false;
  return std::chrono::duration<double>(Clock::now() - taken_at_).count() > options_.patience;
}

bool PlanQueue::ask(const std::shared_ptr<Place>& place, const std::function<bool()>& stop_asked) {
  std::unique_lock lock(mutex_);
  if (!closed_) waiting_.push_back(place);
  if (enough()) changed_.notify_all();
  const auto forget = [&] {
    std::erase(waiting_, place);
    place->state = Place::State::kRefused;
  };
  while (!closed_ && place->state == Place::State::kWaiting) {
    place->settled.wait_for(lock, kLookAround);
    if (place->state != Place::State::kWaiting) break;
    if (out_of_patience(*place)) {
      forget();
      place->message = fmt::format("no plan within {:g} s: its function has not come back", options_.patience);
    } else if (stop_asked && stop_asked()) {
      forget();
      return false;
    }
  }
  if (place->state != Place::State::kWaiting) return true;
  forget();
  place->message = why_;
  return true;
}

std::vector<std::shared_ptr<const PlanRequest>> PlanQueue::take(double seconds) {
  std::unique_lock lock(mutex_);
  in_work_.clear();
  changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return closed_ || enough(); });
  if (closed_ || !enough()) return {};
  in_work_ = std::exchange(waiting_, {});
  taken_at_ = Clock::now();
  std::ranges::sort(in_work_, {}, [](const std::shared_ptr<Place>& place) { return place->request.episode; });
  std::vector<std::shared_ptr<const PlanRequest>> requests;
  requests.reserve(in_work_.size());
  for (const std::shared_ptr<Place>& place : in_work_) requests.emplace_back(place, &place->request);
  return requests;
}

void PlanQueue::settle(const PlanRequest& request, const std::function<void(Place&)>& how) {
  const std::lock_guard lock(mutex_);
  const auto found = std::ranges::find_if(in_work_, [&](const auto& place) { return &place->request == &request; });
  if (found == in_work_.end()) return;
  const std::shared_ptr<Place> place = *found;
  in_work_.erase(found);
  if (place->state != Place::State::kWaiting) return;
  how(*place);
  place->settled.notify_all();
}

void PlanQueue::answer(const PlanRequest& request, std::span<const double> numbers, int rows) {
  const std::shared_ptr<const RobotModel> body = robot();
  const int width = kBeforeJoints + body->dof();
  require((rows == kAnchors || rows == kDensePlan) && numbers.size() == static_cast<std::size_t>(rows * width),
          "policy '{}': plan: expected ({}, {}) or ({}, {}) numbers, found {} rows and {} numbers", options_.name,
          kAnchors, width, kDensePlan, width, rows, numbers.size());
  const std::string fault = fault_of_plan(numbers, rows);
  std::vector<Reference> plan;
  if (fault.empty()) plan = references_of(numbers, rows, *body);
  settle(request, [&](Place& place) {
    place.state = fault.empty() ? Place::State::kPlanned : Place::State::kInvalid;
    place.message = fault;
    place.plan = std::move(plan);
  });
}

void PlanQueue::refuse(const PlanRequest& request, const std::string& why) {
  settle(request, [&](Place& place) {
    place.state = Place::State::kRefused;
    place.message = why;
  });
}

void PlanQueue::close(const std::string& why) {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  why_ = why;
  for (const auto* places : {&waiting_, &in_work_})
    for (const std::shared_ptr<Place>& place : *places) place->settled.notify_all();
  changed_.notify_all();
}

bool PlanQueue::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

}  // namespace duet
