#include "duet/execution/stepped_episodes.h"

#include <sys/wait.h>

#include <limits>

#include "duet/core/require.h"
#include "duet/policies/catalogue/registry.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

std::shared_ptr<const Experiment> led(const SteppedPart& part = {}) {
  Progress quiet(Progress::Style::kQuiet);
  return stepped_experiment(test::playback_suite(), part, 1, quiet);
}

// The null arm's answer to a question.
std::vector<double> holding(const PlanRequest& request, const RobotModel& robot) {
  const Pose& X = request.standing;
  std::vector<double> numbers;
  for (int row = 0; row < kAnchors; ++row) {
    numbers.insert(numbers.end(), {X.p.x(), X.p.y(), X.p.z(), X.R.w(), X.R.x(), X.R.y(), X.R.z()});
    numbers.insert(numbers.end(), robot.neutral.data(), robot.neutral.data() + robot.dof());
  }
  return numbers;
}

TEST(SteppedEpisode, LeadsToTheRowOfTheSameEpisodeUnderAPolicy) {
  const std::shared_ptr<const Experiment> suite = led();
  ASSERT_EQ(suite->size(), 2);
  SteppedEpisode episode(suite);
  int questions = 0;
  for (auto request = episode.begin(1); request != nullptr; ++questions) {
    EXPECT_EQ(request->tick, questions * kTicksPerPlan);
    request = episode.go_on(holding(*request, *suite->bodies().nominal()), kAnchors);
  }
  EXPECT_GT(questions, 5);
  EXPECT_TRUE(episode.is_over());
  ASSERT_TRUE(episode.row().has_value());
  const EpisodeRow expected = suite->run(1, {.policy = policy_maker("null", suite->bodies().nominal())});
  EXPECT_EQ(episode.row()->outcome, Outcome::kOk);
  EXPECT_EQ(episode.row()->state_hash, expected.state_hash);
  EXPECT_EQ(episode.row()->key, expected.key);
  EXPECT_EQ(episode.row()->seed, expected.seed);
}

TEST(SteppedEpisode, AForkedChildThatGoesOnIsToldAndDoesNotWait) {
  const std::shared_ptr<const Experiment> suite = led();
  auto episode = std::make_unique<SteppedEpisode>(suite);
  const auto request = episode->begin(0);
  const std::vector<double> plan = holding(*request, *suite->bodies().nominal());
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(60);
    const std::string said = thrown_message<std::runtime_error>([&] { episode->go_on(plan, kAnchors); });
    const std::string begun = thrown_message<std::runtime_error>([&] { episode->begin(1); });
    episode->stop();
    episode.reset();
    ::_exit(said.find("forked from it") != std::string::npos && begun == said ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_NE(episode->go_on(plan, kAnchors), nullptr);
}

TEST(LedExperiment, SaysHowManyQuestionsAnEpisodeAsksAtMost) {
  const std::shared_ptr<const Experiment> suite = led();
  for (int number = 0; number < suite->size(); ++number) {
    SteppedEpisode episode(suite);
    int questions = 0;
    for (auto request = episode.begin(number); request != nullptr; ++questions)
      request = episode.go_on(holding(*request, *suite->bodies().nominal()), kAnchors);
    EXPECT_EQ(questions, questions_of(*suite, number));
  }
}

// The partner's joints in the newest frame that a question shows.
Eigen::MatrixXd partner_in(const PlanRequest& request) {
  return request.frames.col(kHistoryFrames - 1).segment(3, 3 * kSmplJoints).reshaped(3, kSmplJoints);
}

TEST(SteppedEpisode, APartnerWhoIsLedGoesWhereTheyAreLed) {
  const std::shared_ptr<const Experiment> suite = led();
  SteppedEpisode episode(suite, DrivenBodies::kBoth);
  const auto first = episode.begin(0);
  ASSERT_NE(first, nullptr);
  PointTracks ahead = episode.partner_ahead();
  ASSERT_EQ(ahead.frames(), kTicksPerPlan);
  for (int i = 0; i < kTicksPerPlan; ++i) ahead.frame(i).row(1).array() += 0.1 * (i + 1);
  episode.lead_partner(ahead);
  const auto second = episode.go_on(holding(*first, *suite->bodies().nominal()), kAnchors);
  ASSERT_NE(second, nullptr);
  EXPECT_EQ(partner_in(*second), ahead.frame(kTicksPerPlan - 1));
  const auto third =
      episode.go_on(holding(*second, *suite->bodies().nominal()), kAnchors);  // from here on as in the clip
  ASSERT_NE(third, nullptr);
  EXPECT_LT((partner_in(*third) - partner_in(*first)).cwiseAbs().maxCoeff(), 0.5);
}

TEST(SteppedEpisode, APartnerWhoIsNotLedOtherwiseFollowsTheClip) {
  const std::shared_ptr<const Experiment> suite = led();
  std::vector<Eigen::MatrixXd> alone, both;
  for (auto* seen : {&alone, &both}) {
    SteppedEpisode episode(suite, seen == &both ? DrivenBodies::kBoth : DrivenBodies::kRobot);
    for (auto request = episode.begin(1); request != nullptr;) {
      seen->push_back(request->frames);
      if (seen == &both) episode.lead_partner(episode.partner_ahead());
      request = episode.go_on(holding(*request, *suite->bodies().nominal()), kAnchors);
    }
    EXPECT_EQ(episode.row()->outcome, Outcome::kOk);
  }
  EXPECT_EQ(alone, both);
}

TEST(SteppedEpisode, RefusesToLeadAPartnerWhereItCannot) {
  SteppedEpisode alone(led());
  ASSERT_NE(alone.begin(0), nullptr);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { alone.lead_partner({}); }));
  SteppedEpisode both(led(), DrivenBodies::kBoth);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { static_cast<void>(both.partner_ahead()); }));
  ASSERT_NE(both.begin(0), nullptr);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { both.lead_partner(PointTracks(3, kSmplJoints)); }));
  PointTracks ahead = both.partner_ahead();
  ahead.at(4, 7).x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { both.lead_partner(ahead); }));
}

TEST(SteppedEpisode, BeginsAnotherInTheMiddleOfOne) {
  const std::shared_ptr<const Experiment> suite = led();
  SteppedEpisode episode(suite);
  const auto first = episode.begin(0);
  ASSERT_NE(first, nullptr);
  ASSERT_NE(episode.go_on(holding(*first, *suite->bodies().nominal()), kAnchors), nullptr);
  const auto again = episode.begin(0);
  ASSERT_NE(again, nullptr);
  EXPECT_EQ(again->tick, 0);
  EXPECT_EQ(again->frames, first->frames);
  episode.stop();
  EXPECT_TRUE(episode.is_over());
  EXPECT_FALSE(episode.row().has_value());
}

TEST(SteppedEpisode, RefusesWhatItCannotLead) {
  SteppedEpisode episode(led());
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { episode.next(); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { episode.begin(2); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { episode.answer({}, kAnchors); }));
  ASSERT_NE(episode.begin(0), nullptr);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { episode.answer(std::vector<double>(10), kAnchors); }));
}

TEST(LedExperiment, RefusesNamesThatTheSuiteDoesNotHave) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { led({.engine = "mujoco"}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { led({.controller = "vmc"}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { led({.perturbation = "ice"}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { led({.task = "waltz"}); }));
}

TEST(LedExperiment, ChoosesATask) {
  const std::shared_ptr<const Experiment> suite = led({.task = "handshake"});
  ASSERT_EQ(suite->size(), 1);
  EXPECT_EQ(suite->at(0).clip->task, Task::kHandshake);
}

}  // namespace
}  // namespace duet
