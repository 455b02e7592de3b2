// Audits of controllers: trials in physics, the search among other readings, and slips of adapters that have names.
#include "duet/rollout/audit/controller_audit.h"

#include <gmock/gmock.h>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/nn/catalogue/load_network.h"
#include "tests/backends/engine_names.h"
#include "tests/controllers/audit_defects.h"
#include "tests/support.h"

namespace duet {
namespace {

TEST(Trial, IsToldWhatTheDescriptorTakes) {
  const std::vector<TrialTask> tasks = trial_tasks(load_descriptor("humanoid_gym"));
  ASSERT_EQ(tasks.size(), 4U);
  EXPECT_EQ(tasks[0].command(), "0,0,0");
  EXPECT_EQ(tasks[1].command(), "0.5,0,0");
  EXPECT_EQ(tasks[2].command(), "0,0.3,0");
  EXPECT_EQ(tasks[3].command(), "0,0,0.3");
  EXPECT_EQ(trial_tasks(load_descriptor("twist2")).size(), 1U);  // a tracker stands
}

TEST(TrialPhysics, IsOfTheDescriptorElseOfTheNetworkElseOfTheProfile) {
  const Metadata metadata = {{"experiment_config", R"({"simulator": {"config": {"sim": {"fps": 200}}}})"}};
  Descriptor descriptor = load_descriptor("rl_gym");
  const auto robot = load_shared_robot(card_path(descriptor.robot));
  const TrialPhysics plain = trial_physics(descriptor, {}, *robot);
  EXPECT_EQ(plain.dt, 0.0);
  EXPECT_EQ(plain.height, robot->standing_height);
  const TrialPhysics of_file = trial_physics(descriptor, metadata, *robot);
  EXPECT_DOUBLE_EQ(of_file.dt, 0.005);
  descriptor.own_physics = OwnPhysics{.dt = 0.001, .height = 0.7};
  const TrialPhysics own = trial_physics(descriptor, metadata, *robot);
  EXPECT_DOUBLE_EQ(own.dt, 0.001);
  EXPECT_DOUBLE_EQ(own.height, 0.7);
  descriptor.own_physics->dt = 0.003;
  const TrialPhysics odd = trial_physics(descriptor, metadata, *robot);
  EXPECT_EQ(odd.dt, 0.0);
  for (const TrialPhysics& each : {plain, of_file, own, odd}) EXPECT_SENTENCE(each.dt_from + "; " + each.height_from);
}

TEST(TrialPhysics, AFileThatSaysItOtherwiseSaysNothing) {
  for (const char* config : {"", "{}", "[1]", "simulator: {config: {sim: {fps: many}}}", "simulator: 3", "{{"})
    EXPECT_FALSE(physics_step_of({{"experiment_config", config}}).has_value()) << config;
  EXPECT_FALSE(physics_step_of({}).has_value());
}

TEST(Trial, OfAPdControllerEndsWhereItFalls) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const auto robot = load_shared_robot(card_path("g1"));
  TrialGround ground("mujoco", robot);
  const TrialTask task = {.name = "stand", .seconds = 2.5};
  const auto pd = make_pd_controller(robot);
  const TrialResult result = ground.run(*pd, task, {});
  EXPECT_FALSE(result.upright);
  EXPECT_GT(result.lasted, 0.5);
  EXPECT_LT(result.lasted, 2.0);
  EXPECT_GT(trial_cost(task, result), 1.0);
  EXPECT_EQ(ground.run(*pd, task, {}).lasted, result.lasted);  // the ground forgets
}

TEST(Trial, CostsLessTheCloserItComes) {
  const TrialTask task = {.name = "forward", .told = {0.5, 0, 0}, .seconds = 3.0};
  TrialResult right{.upright = true, .lasted = 3.0, .went = {0.5, 0, 0}};
  TrialResult slow = right, fell = right, fell_early = right;
  slow.went.x() = 0.2;
  fell.upright = fell_early.upright = false;
  fell.lasted = 2.0;
  fell_early.lasted = 1.0;
  EXPECT_LT(trial_cost(task, right), trial_cost(task, slow));
  EXPECT_LE(trial_cost(task, slow), 1.0);
  EXPECT_LT(1.0, trial_cost(task, fell));
  EXPECT_LT(trial_cost(task, fell), trial_cost(task, fell_early));
}

// The smallest of the published networks, so that all of its readings take seconds.
AuditSubject small_subject() {
  AuditSubject subject;
  subject.descriptor = load_descriptor("rl_gym");
  subject.robot = load_shared_robot(card_path(subject.descriptor.robot));
  const std::string path = test::shared_file("models/" + subject.descriptor.network);
  subject.make = controllers_of_network(subject.robot, load_network_file(path).make, path);
  return subject;
}

TEST(ControllerAudit, NamesNothingOfADescriptorThatIsRight) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  if (test::shared_file("models/unitree_rl_gym_g1_motion.pt").empty()) GTEST_SKIP() << "not run: models absent";
  const ControllerAudit audit = audit_controller(small_subject());
  EXPECT_TRUE(audit.defects.empty()) << audit.defects[0].said;
  EXPECT_GT(audit.readings, 100);
  EXPECT_THAT(audit.verdict, testing::HasSubstr("Nothing is named"));
}

TEST(ControllerAudit, NamesWhatAnAdapterGotWrong) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  if (test::shared_file("models/unitree_rl_gym_g1_motion.pt").empty()) GTEST_SKIP() << "not run: models absent";
  int named = 0;
  for (const test::InjectedDefect& defect : test::injected_defects()) {
    if (std::string(defect.controller) != "rl_gym") continue;
    AuditSubject subject = small_subject();
    ASSERT_TRUE(defect.inject(subject.descriptor, *subject.robot));
    const ControllerAudit audit = audit_controller(subject);
    ASSERT_FALSE(audit.defects.empty()) << defect.name;
    EXPECT_EQ(to_string(audit.defects[0].part), to_string(defect.part)) << defect.name << ": " << audit.defects[0].said;
    EXPECT_THAT(audit.verdict, testing::HasSubstr("The contract is wrong"));
    ++named;
  }
  EXPECT_EQ(named, 2);
}

}  // namespace
}  // namespace duet
