#include "duet/training/train_wbc.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/training/fixtures.h"

namespace duet {
namespace {

using testing::HasSubstr;

using test::g1;

class TrainWbcInMujoco : public test::InMujoco {};

WbcRun small_run(const std::string& folder, const std::string& stage) {
  WbcRun run;
  run.stage = stage;
  run.folder = folder;
  run.environments = 8;
  run.steps = 1024;
  return run;
}

bool train(
    const WbcRun& run, const std::function<bool()>& stop = [] { return false; }) {
  return train_wbc(
      g1(), run, [](const WbcProgress&) {}, stop);
}

TEST_F(TrainWbcInMujoco, AStageLeavesACheckpointANetworkAndCurves) {
  const test::ScratchFolder scratch;
  EXPECT_TRUE(train(small_run(scratch / "wbc", "stand")));
  EXPECT_EQ(load_wbc_network(wbc_network_file(scratch / "wbc", "stand"), *g1()).kind, WbcKind::kOracle);
  const std::string curves = read_file(wbc_curves(scratch / "wbc", "stand"));
  EXPECT_THAT(curves, HasSubstr("steps,minutes,return"));
  EXPECT_THAT(curves, HasSubstr("\n1024,"));
  EXPECT_TRUE(train(small_run(scratch / "wbc", "walk")));
  WbcRun student = small_run(scratch / "wbc", "student");
  student.from = wbc_checkpoint(scratch / "wbc", "walk");
  EXPECT_TRUE(train(student));
  EXPECT_EQ(load_wbc_network(wbc_network_file(scratch / "wbc", "student"), *g1()).kind, WbcKind::kStudent);
}

TEST(WbcPlan, EachStageTrainsOnATaskThatIsThere) {
  for (const WbcStage& stage : wbc_plan()) EXPECT_EQ(wbc_stage(stage.task).name, stage.task) << stage.name;
  EXPECT_EQ(find_wbc_stage("student").task, "interact");
  EXPECT_TRUE(find_wbc_stage("student").distils && find_wbc_stage("student").follows);
  EXPECT_FALSE(find_wbc_stage("walk").distils || find_wbc_stage("walk").follows);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { static_cast<void>(find_wbc_stage("wlak")); }));
}

TEST_F(TrainWbcInMujoco, ANetworkSaysWhichGaitItWasLearntWith) {
  const test::ScratchFolder scratch;
  train(small_run(scratch / "wbc", "stand"));
  EXPECT_EQ(load_wbc_network(wbc_network_file(scratch / "wbc", "stand"), *g1()).gait.capture_time, 0.0);
  for (const char* stage : {"brace", "student"}) {
    WbcRun run = small_run(scratch / "wbc", stage);
    run.from = wbc_network_file(scratch / "wbc", "stand");
    train(run);
    const GaitOptions gait = load_wbc_network(wbc_network_file(scratch / "wbc", stage), *g1()).gait;
    EXPECT_EQ(gait.capture_time, wbc_stage("brace").gait.capture_time) << stage;
    EXPECT_GT(gait.max_speed, 0.8) << stage;
  }
}

TEST_F(TrainWbcInMujoco, AStoppedStageGoesOnWhereItWas) {
  const test::ScratchFolder scratch;
  int asked = 0;
  EXPECT_FALSE(train(small_run(scratch / "wbc", "stand"), [&] { return ++asked > 1; }));
  const std::string file = wbc_checkpoint(scratch / "wbc", "stand");
  EXPECT_EQ(training_state(read_safetensors(file), file).steps, 512);
  EXPECT_TRUE(train(small_run(scratch / "wbc", "stand")));
  EXPECT_EQ(training_state(read_safetensors(file), file).steps, 1024);
}

// The critic is new: while it learns alone the actor stays as it is, also in a training that was stopped in between.
TEST_F(TrainWbcInMujoco, BeginsWithTheNetworkOfAnOracle) {
  const test::ScratchFolder scratch;
  train(small_run(scratch / "wbc", "stand"));
  WbcRun finer = small_run(scratch / "finer", "brace");
  finer.from = wbc_network_file(scratch / "wbc", "stand");
  int asked = 0;
  EXPECT_FALSE(train(finer, [&] { return ++asked > 1; }));
  EXPECT_TRUE(train(finer));
  const WbcNetwork before = load_wbc_network(finer.from, *g1());
  const std::string file = wbc_checkpoint(scratch / "finer", "brace");
  const TrainingState after = training_state(read_safetensors(file), file);
  EXPECT_GT(after.critic_alone, 2);
  EXPECT_EQ(after.iteration, 2);
  for (size_t i = 0; i < before.mlp.layers.size(); ++i)
    EXPECT_EQ(after.agent.actor.layers[i].W, before.mlp.layers[i].W) << "layer " << i;
  EXPECT_LT((after.agent.actor_input.deviation() - before.deviation).cwiseAbs().maxCoeff(), 0.05F);
}

TEST_F(TrainWbcInMujoco, TheNetworkOfAStudentIsNoBeginning) {
  const test::ScratchFolder scratch;
  train(small_run(scratch / "wbc", "stand"));
  WbcRun student = small_run(scratch / "wbc", "student");
  student.from = wbc_network_file(scratch / "wbc", "stand");
  train(student);
  WbcRun walk = small_run(scratch / "wbc", "walk");
  walk.from = wbc_network_file(scratch / "wbc", "student");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { train(walk); }));
}

TEST_F(TrainWbcInMujoco, ABrokenCheckpointStopsTheTrainingAndStays) {
  const test::ScratchFolder scratch;
  train(small_run(scratch / "wbc", "stand"));
  const std::string file = wbc_checkpoint(scratch / "wbc", "stand");
  const std::string half = read_file(file).substr(0, 5000);
  write_file(file, half);
  EXPECT_THROW(train(small_run(scratch / "wbc", "stand")), InputError);
  EXPECT_EQ(read_file(file), half);
}

TEST_F(TrainWbcInMujoco, ACheckpointOfAnotherRobotOrSeedIsRefused) {
  const test::ScratchFolder scratch;
  train(small_run(scratch / "wbc", "stand"));
  const std::string file = wbc_checkpoint(scratch / "wbc", "stand");
  WbcRun other = small_run(scratch / "wbc", "stand");
  other.seed = 9;
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { train(other); }));
  SafeTensors tensors = read_safetensors(file);
  tensors.metadata["robot_digest"] = "abc";
  write_safetensors(file, tensors);
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { train(small_run(scratch / "wbc", "stand")); }));
}

// The network that --from names was once the beginning of every stage.
TEST(TrainWbc, OnlyTheFirstOfAllStagesBeginsWithWhatIsNamed) {
  WbcRun run;
  run.from = "oracle.safetensors";
  run.seed = 7;
  std::vector<std::string> stages, from;
  for (const WbcRun& next : wbc_runs(run)) {
    stages.push_back(next.stage);
    from.push_back(next.from);
    EXPECT_EQ(next.seed, 7U);
  }
  EXPECT_THAT(stages, testing::ElementsAre("stand", "walk", "brace", "interact", "student"));
  EXPECT_THAT(from, testing::ElementsAre("oracle.safetensors", "", "", "", ""));
}

TEST(TrainWbc, AStageWithoutItsPredecessorSaysWhatToDo) {
  const test::ScratchFolder scratch;
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { train(small_run(scratch / "wbc", "walk")); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { train(small_run(scratch / "wbc", "wlk")); }));
}

}  // namespace
}  // namespace duet
