#include "duet/core/task.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "duet/core/task.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

TEST(Task, NameAndParseAreInverse) {
  for (const Task task : all_tasks()) EXPECT_EQ(parse_task(to_string(task)), task);
  EXPECT_EQ(to_string(Task::kHug), "hug");
  EXPECT_EQ(to_string(Task::kFlyKiss), "fly_kiss");
}

TEST(Task, OfTheSupplementComeFirst) {
  ASSERT_GE(all_tasks().size(), kPaperTasks.size());
  for (std::size_t i = 0; i < all_tasks().size(); ++i) EXPECT_EQ(all_tasks()[i].index(), static_cast<int>(i));
  for (std::size_t i = 0; i < kPaperTasks.size(); ++i) EXPECT_EQ(all_tasks()[i], kPaperTasks[i]);
}

TEST(Task, AcceptsDashes) {
  EXPECT_EQ(parse_task("high-five"), Task::kHighFive);
  EXPECT_EQ(parse_task("fly-kiss"), Task::kFlyKiss);
}

TEST(Task, RefusesAnUnknownName) {
  EXPECT_EQ(thrown_message<std::invalid_argument>([] { parse_task("hgu"); }),
            fmt::format("unknown task 'hgu': did you mean 'hug'? Known: {}", fmt::join(task_names(all_tasks()), ", ")));
  EXPECT_THROW(parse_task(""), std::invalid_argument);
  EXPECT_THROW(parse_task("Hug"), std::invalid_argument);
}

TEST(Phases, CoverEveryFrameOnce) {
  const Phases phases{3, 5};
  const Phase expected[] = {Phase::kPreparation, Phase::kPreparation, Phase::kPreparation, Phase::kAct,
                            Phase::kAct,         Phase::kFollowUp,    Phase::kFollowUp};
  for (int t = 0; t < 7; ++t) EXPECT_EQ(phases.at(t), expected[t]) << t;
}

TEST(Phases, HaveNames) {
  EXPECT_EQ(to_string(Phase::kPreparation), "preparation");
  EXPECT_EQ(to_string(Phase::kAct), "act");
  EXPECT_EQ(to_string(Phase::kFollowUp), "follow_up");
}

TEST(Outcome, NameAndParseAreInverse) {
  const std::pair<Outcome, const char*> all[] = {{Outcome::kOk, "ok"},
                                                 {Outcome::kFell, "fell"},
                                                 {Outcome::kDiverged, "diverged"},
                                                 {Outcome::kTimedOut, "timeout"},
                                                 {Outcome::kUnsupported, "unsupported"},
                                                 {Outcome::kError, "error"}};
  for (const auto& [outcome, name] : all) {
    EXPECT_EQ(to_string(outcome), name);
    EXPECT_EQ(parse_outcome(name), outcome);
  }
}

TEST(Outcome, RefusesAnUnknownName) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { parse_outcome("timeouts"); }));
}

}  // namespace
}  // namespace duet
