#include "duet/policies/dstar/retrieval.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "duet/core/require.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/robots/robot_model.h"
#include "tests/support.h"

namespace duet {
namespace {

std::shared_ptr<const RobotModel> robot() {
  static const auto model = load_shared_robot("");
  return model;
}

// Three windows; the plan of each says which it is, in the first joint.
RetrievalLibrary made_library() {
  RetrievalLibrary library;
  library.robot = robot()->name;
  library.joints = robot()->joint_names();
  library.tasks = {0, 0, 1};
  library.mean = Eigen::VectorXf::Zero(kRetrievalKey);
  library.deviation = Eigen::VectorXf::Ones(kRetrievalKey);
  library.keys = Eigen::MatrixXf::Zero(kRetrievalKey, 3);
  library.keys(0, 1) = library.keys(0, 2) = 2.0F;
  library.plans = Eigen::MatrixXf::Zero(kPlanSize, 3);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < kAnchors; ++k) {
      library.plans(kAnchorSize * k + 2, i) = 0.75F;
      library.plans(kAnchorSize * k + 3, i) = 1.0F;
      library.plans(kAnchorSize * k + 7 + 18, i) = 0.125F * static_cast<float>(i + 1);
    }
  return library;
}

std::unique_ptr<Policy> made_policy() {
  const test::ScratchFolder folder;
  save_retrieval_library(folder / "library.safetensors", made_library());
  return make_policy("retrieval", robot(), {{"library", folder / "library.safetensors"}});
}

EpisodeContext hug() {
  EpisodeContext context;
  context.task = Task::kHug;
  context.start = robot()->standing_state();
  return context;
}

Observation looking_at(const ObservationFrame& frame, std::array<ObservationFrame, kHistoryFrames>& history) {
  history.fill(frame);
  return {history, 0};
}

TEST(Retrieval, FindsTheNearestWindowOfTheTask) {
  const RetrievalLibrary library = made_library();
  Eigen::VectorXf key = Eigen::VectorXf::Zero(kRetrievalKey);
  EXPECT_EQ(nearest_window(library, 0, key), 0);
  key[0] = 1.5F;
  EXPECT_EQ(nearest_window(library, 0, key), 1);
  EXPECT_EQ(nearest_window(library, 1, key), 2);
  EXPECT_EQ(nearest_window(library, 4, key), -1);
}

TEST(Retrieval, AnswersWithThePlanOfThatWindow) {
  const auto policy = made_policy();
  const EpisodeContext context = hug();
  policy->reset(context);
  ObservationFrame frame;
  frame.robot = context.start;
  frame.partner.setZero();
  frame.partner.row(0).setConstant(2.0);  // two metres ahead: the second window
  std::array<ObservationFrame, kHistoryFrames> history;
  const Anchors anchors = policy->act(looking_at(frame, history));
  EXPECT_NEAR(anchors[0].q[18] - robot()->neutral[18], 0.25, 1e-6);
  EXPECT_NEAR(anchors[4].X_WB.p.z(), 0.75, 1e-6);
}

TEST(Retrieval, LeavesOutAPlanForWhatIsNotANumber) {
  const auto policy = made_policy();
  const EpisodeContext context = hug();
  policy->reset(context);
  ObservationFrame frame;
  frame.robot = context.start;
  frame.partner.setConstant(std::numeric_limits<double>::quiet_NaN());
  std::array<ObservationFrame, kHistoryFrames> history;
  EXPECT_TRUE(policy->plan(looking_at(frame, history)).empty());
  EXPECT_EQ(policy->faults().invalid, 1);
  EXPECT_SENTENCE(policy->faults().message);
  frame.partner.setZero();
  EXPECT_EQ(policy->plan(looking_at(frame, history)).size(), 100U);
  policy->reset(context);
  EXPECT_FALSE(policy->faults().any());
}

TEST(Retrieval, RefusesATaskThatTheLibraryLacks) {
  const auto policy = made_policy();
  EpisodeContext context;
  context.task = Task::kWave;
  EXPECT_SENTENCE(test::thrown_message<MissingError>([&] { policy->reset(context); }));
}

TEST(Retrieval, RefusesALibraryOfAnotherRobotOrShape) {
  const test::ScratchFolder folder;
  RetrievalLibrary library = made_library();
  library.robot = "h1";
  save_retrieval_library(folder / "robot.safetensors", library);
  EXPECT_SENTENCE(
      test::thrown_message<InputError>([&] { load_retrieval_library(folder / "robot.safetensors", *robot()); }));
  library = made_library();
  library.plans.conservativeResize(kPlanSize - 1, 3);
  save_retrieval_library(folder / "shape.safetensors", library);
  EXPECT_SENTENCE(
      test::thrown_message<InputError>([&] { load_retrieval_library(folder / "shape.safetensors", *robot()); }));
}

}  // namespace
}  // namespace duet
