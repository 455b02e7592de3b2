#include "duet/policies/plan_queue.h"

#include <atomic>
#include <limits>
#include <thread>

#include "duet/policies/reference_policies.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::thrown_message;

constexpr double kLong = 30.0;  // [s] that nothing here takes

std::shared_ptr<PlanQueue> queue_of(double share, double patience = 0.0) {
  return PlanQueue::make({.name = "mine", .patience = patience, .share = share});
}

// Numbers of a plan that holds a pose of this height.
std::vector<double> numbers_at(double height, int rows = kAnchors) {
  std::vector<double> numbers;
  for (int row = 0; row < rows; ++row) {
    numbers.insert(numbers.end(), {0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0});
    numbers.insert(numbers.end(), g1()->neutral.data(), g1()->neutral.data() + g1()->dof());
  }
  return numbers;
}

// A policy in an episode that begins at x = `place`, and one observation of it.
struct AskingEpisode {
  AskingEpisode(const PolicyMaker& make, double place) : policy(make()) {
    context.task = Task::kWave;
    context.prompt = "wave";
    context.seed = 7;
    context.start = g1()->standing_state({Eigen::Quaterniond::Identity(), {place, 0.0, 0.0}});
    policy->reset(context);
    ObservationFrame frame;
    frame.partner.setConstant(place);
    frame.robot = context.start;
    frames.assign(kHistoryFrames, frame);
  }
  std::vector<Reference> ask(int tick = 0) const { return policy->plan({frames, tick}); }

  std::unique_ptr<Policy> policy;
  EpisodeContext context;
  std::vector<ObservationFrame> frames;
};

// The outcome of one question, answered by `how`.
struct Asked {
  std::vector<Reference> plan;
  PolicyFaults faults;
};
Asked ask_once(const std::function<void(PlanQueue&, const PlanRequest&)>& how) {
  const std::shared_ptr<PlanQueue> queue = queue_of(1.0);
  const AskingEpisode episode(queue->maker(g1()), 1.0);
  Asked asked;
  std::thread thread([&] { asked = {episode.ask(), episode.policy->faults()}; });
  const auto requests = queue->take(kLong);
  if (requests.size() == 1) how(*queue, *requests.front());
  queue->close("the test is over");
  thread.join();
  return asked;
}

TEST(PlanQueue, GivesAllWaitingEpisodesAsOneBatchAndEachItsOwnPlan) {
  constexpr int kEpisodes = 5;
  const std::shared_ptr<PlanQueue> queue = queue_of(1.0);
  const PolicyMaker make = queue->maker(g1());
  std::vector<std::unique_ptr<AskingEpisode>> episodes;
  for (int i = 0; i < kEpisodes; ++i) episodes.push_back(std::make_unique<AskingEpisode>(make, i));
  std::vector<std::vector<Reference>> plans(kEpisodes);
  std::vector<std::thread> threads;
  for (int i = 0; i < kEpisodes; ++i) threads.emplace_back([&, i] { plans[i] = episodes[i]->ask(10); });
  const auto requests = queue->take(kLong);
  ASSERT_EQ(requests.size(), 5u);
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const PlanRequest& request = *requests[i];
    EXPECT_EQ(request.episode, static_cast<std::int64_t>(i));
    EXPECT_EQ(request.tick, 10);
    EXPECT_TRUE(request.first);
    EXPECT_EQ(request.task, Task::kWave);
    EXPECT_EQ(request.prompt, "wave");
    EXPECT_EQ(request.seed, 7u);
    EXPECT_EQ(request.frames.rows(), kObservationSize);
    EXPECT_EQ(request.frames.cols(), kHistoryFrames);
    EXPECT_EQ(request.frames(0, 0), request.start.p.x());  // its partner's root is where its robot is
    queue->answer(request, numbers_at(1.0 + request.start.p.x()), kAnchors);
  }
  for (std::thread& thread : threads) thread.join();
  for (int i = 0; i < kEpisodes; ++i) {
    ASSERT_EQ(plans[i].size(), 100u);
    EXPECT_EQ(plans[i].front().X_WB.p.z(), 1.0 + i);
  }
}

TEST(PlanQueue, DoesNotWaitForMoreThanItsShareOfTheEpisodesUnderWay) {
  const std::shared_ptr<PlanQueue> queue = queue_of(0.5);
  const PolicyMaker make = queue->maker(g1());
  const AskingEpisode asks(make, 0.0), silent(make, 1.0);
  std::thread thread([&] { static_cast<void>(asks.ask()); });
  EXPECT_EQ(queue->take(kLong).size(), 1u);
  queue->close("the test is over");
  thread.join();
}

TEST(PlanQueue, WaitsForAllWhereTheShareIsAllUntilOneEnds) {
  const std::shared_ptr<PlanQueue> queue = queue_of(1.0);
  const PolicyMaker make = queue->maker(g1());
  const AskingEpisode asks(make, 0.0);
  auto ends = std::make_unique<AskingEpisode>(make, 1.0);
  std::thread thread([&] { static_cast<void>(asks.ask()); });
  EXPECT_TRUE(queue->take(0.05).empty());
  ends.reset();
  EXPECT_EQ(queue->take(kLong).size(), 1u);
  queue->close("the test is over");
  thread.join();
}

TEST(PlanQueue, AnswersOfTheNullArmGiveItsReferencesToTheBit) {
  const Asked asked = ask_once([](PlanQueue& queue, const PlanRequest& request) {
    const Eigen::Quaterniond& R = request.standing.R;
    const Eigen::Vector3d& p = request.standing.p;
    std::vector<double> numbers;
    for (int row = 0; row < kAnchors; ++row) {
      numbers.insert(numbers.end(), {p.x(), p.y(), p.z(), R.w(), R.x(), R.y(), R.z()});
      numbers.insert(numbers.end(), g1()->neutral.data(), g1()->neutral.data() + g1()->dof());
    }
    queue.answer(request, numbers, kAnchors);
  });
  const AskingEpisode episode([] { return std::make_unique<NullPolicy>(g1()); }, 1.0);
  const std::vector<Reference> expected = episode.ask();
  ASSERT_EQ(asked.plan.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(asked.plan[i].q, expected[i].q);
    EXPECT_EQ(asked.plan[i].X_WB.p, expected[i].X_WB.p);
    EXPECT_EQ(asked.plan[i].X_WB.R.coeffs(), expected[i].X_WB.R.coeffs());
  }
}

TEST(PlanQueue, TakesADensePlanRowByRow) {
  const Asked asked = ask_once([](PlanQueue& queue, const PlanRequest& request) {
    std::vector<double> numbers = numbers_at(0.8, kDensePlan);
    numbers[36 * 99 + 2] = 0.7;
    queue.answer(request, numbers, kDensePlan);
  });
  ASSERT_EQ(asked.plan.size(), 100u);
  EXPECT_EQ(asked.plan[98].X_WB.p.z(), 0.8);
  EXPECT_EQ(asked.plan[99].X_WB.p.z(), 0.7);
}

TEST(PlanQueue, ClampsJointsAndMakesQuaternionsUnit) {
  const Asked asked = ask_once([](PlanQueue& queue, const PlanRequest& request) {
    std::vector<double> numbers = numbers_at(0.8);
    numbers[3] = 2.0;
    numbers[7] = 1e6;
    queue.answer(request, numbers, kAnchors);
  });
  EXPECT_EQ(asked.plan.at(0).X_WB.R.w(), 1.0);
  EXPECT_EQ(asked.plan.at(0).q[0], g1()->joints[0].upper);
  EXPECT_FALSE(asked.faults.any());
}

TEST(PlanQueue, LeavesOutAPlanThatIsNotFiniteAndSaysWhere) {
  const Asked asked = ask_once([](PlanQueue& queue, const PlanRequest& request) {
    std::vector<double> numbers = numbers_at(0.8);
    numbers[36 + 2] = std::numeric_limits<double>::quiet_NaN();
    queue.answer(request, numbers, kAnchors);
  });
  EXPECT_TRUE(asked.plan.empty());
  EXPECT_EQ(asked.faults.invalid, 1);
  EXPECT_FALSE(asked.faults.dead);
  EXPECT_SENTENCE(asked.faults.message);
}

TEST(PlanQueue, LeavesOutAPlanWithoutADirection) {
  const Asked asked = ask_once([](PlanQueue& queue, const PlanRequest& request) {
    std::vector<double> numbers = numbers_at(0.8);
    numbers[3] = 0.0;
    queue.answer(request, numbers, kAnchors);
  });
  EXPECT_TRUE(asked.plan.empty());
  EXPECT_SENTENCE(asked.faults.message);
}

TEST(PlanQueue, RefusesAPlanOfAnotherShape) {
  ask_once([](PlanQueue& queue, const PlanRequest& request) {
    const std::string message =
        thrown_message<std::invalid_argument>([&] { queue.answer(request, numbers_at(0.8, 3), 3); });
    EXPECT_SENTENCE(message);
  });
}

TEST(PlanQueue, AnEpisodeThatIsRefusedEndsWithTheReason) {
  const Asked asked = ask_once(
      [](PlanQueue& queue, const PlanRequest& request) { queue.refuse(request, "ValueError: no such partner"); });
  EXPECT_TRUE(asked.plan.empty());
  EXPECT_TRUE(asked.faults.dead);
  EXPECT_SENTENCE(asked.faults.message);
}

TEST(PlanQueue, EpisodesOutliveACallerWhoDoesNotComeBack) {
  const std::shared_ptr<PlanQueue> queue = queue_of(1.0, 0.05);
  const AskingEpisode first(queue->maker(g1()), 0.0);
  std::thread taker([&] { EXPECT_EQ(queue->take(kLong).size(), 1u); });  // and never answers
  EXPECT_TRUE(first.ask().empty());
  taker.join();
  EXPECT_TRUE(first.policy->faults().dead);
  EXPECT_SENTENCE(first.policy->faults().message);
  const AskingEpisode later(queue->maker(g1()), 0.0);
  EXPECT_TRUE(later.ask().empty());
  EXPECT_TRUE(later.policy->faults().dead);
}

TEST(PlanQueue, AnEpisodeThatIsStoppedHasNoFault) {
  const std::shared_ptr<PlanQueue> queue = queue_of(1.0);
  AskingEpisode episode(queue->maker(g1()), 0.0);
  episode.context.stop_asked = [] { return true; };
  episode.policy->reset(episode.context);
  EXPECT_TRUE(episode.ask().empty());
  EXPECT_FALSE(episode.policy->faults().any());
  EXPECT_TRUE(queue->take(0.0).empty());  // its question is withdrawn
}

TEST(PlanQueue, NobodyWaitsAtAClosedQueue) {
  const std::shared_ptr<PlanQueue> queue = queue_of(1.0);
  const AskingEpisode episode(queue->maker(g1()), 0.0);
  queue->close("the caller has gone");
  EXPECT_TRUE(queue->closed());
  EXPECT_TRUE(episode.ask().empty());
  EXPECT_SENTENCE(episode.policy->faults().message);
  EXPECT_TRUE(queue->take(kLong).empty());
}

TEST(PlanQueue, IsOfOneRobot) {
  const std::shared_ptr<PlanQueue> queue = queue_of(1.0);
  static_cast<void>(queue->maker(g1()));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { static_cast<void>(queue->maker(test::t1())); }));
  EXPECT_EQ(queue->robot(), g1());
}

TEST(PlanQueue, RefusesOptionsOutOfRange) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { static_cast<void>(queue_of(0.0)); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { static_cast<void>(queue_of(0.5, -1.0)); }));
}

}  // namespace
}  // namespace duet
