#include "duet/training/ppo.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "duet/core/require.h"
#include "duet/training/distill.h"
#include "tests/training/fixtures.h"

namespace duet {
namespace {

using test::g1;

class DistillationInMujoco : public test::InMujoco {};
class PpoInMujoco : public test::InMujoco {};
class TrainingStateInMujoco : public test::InMujoco {};

PpoOptions small() {
  PpoOptions options;
  options.environments = 4;
  options.horizon = 16;
  options.epochs = 2;
  options.minibatches = 2;
  return options;
}

TrainingState fresh(std::uint64_t seed = 1) {
  TrainingState state;
  state.agent = make_agent(163, 361, 29, 0.5, seed);
  state.seed = seed;
  state.stage = "stand";
  state.robot_digest = g1()->digest;
  return state;
}

TEST_F(PpoInMujoco, TheSeedDecidesEveryWeight) {
  Ppo a(g1(), wbc_stage("stand"), small(), fresh()), b(g1(), wbc_stage("stand"), small(), fresh());
  Ppo c(g1(), wbc_stage("stand"), small(), fresh(2));
  for (int i = 0; i < 2; ++i) {
    a.iterate();
    b.iterate();
    c.iterate();
  }
  EXPECT_EQ(a.state().agent.actor.layers[1].W, b.state().agent.actor.layers[1].W);
  EXPECT_EQ(a.state().agent.log_std, b.state().agent.log_std);
  EXPECT_NE(a.state().agent.actor.layers[1].W, c.state().agent.actor.layers[1].W);
}

TEST_F(PpoInMujoco, AnIterationCountsItsStepsAndMovesTheWeights) {
  Ppo ppo(g1(), wbc_stage("stand"), small(), fresh());
  const Mlp before = ppo.state().agent.actor;
  const IterationReport report = ppo.iterate();
  EXPECT_EQ(report.steps, 64);
  EXPECT_EQ(report.iteration, 1);
  EXPECT_GT(report.divergence, 0.0);
  EXPECT_NE(before.layers[0].W, ppo.state().agent.actor.layers[0].W);
}

TEST_F(PpoInMujoco, NoActionIsDrawnFartherThanTheLargestDeviation) {
  PpoOptions options = small();
  options.largest_std = 0.3;
  Ppo ppo(g1(), wbc_stage("stand"), options, fresh());  // begins with 0.5
  ppo.iterate();
  EXPECT_LE(ppo.state().agent.log_std.maxCoeff(), std::log(0.3F) + 1e-6F);
}

// No episode that ended can have lasted longer than what was simulated.
TEST_F(PpoInMujoco, EpisodesAreAsLongAsTheirTicks) {
  PpoOptions options = small();
  options.horizon = 150;
  options.epochs = 1;
  Ppo ppo(g1(), wbc_stage("stand"), options, fresh());
  const IterationReport report = ppo.iterate();
  ASSERT_GT(report.episodes, 0);
  EXPECT_GT(report.episode_seconds, 0.02);
  EXPECT_LE(report.episode_seconds, 150 * 0.02);
}

TEST(Ppo, OptionsThatDoNotDivideAreRefused) {
  PpoOptions options = small();
  options.environments = 5;
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { Ppo(g1(), wbc_stage("stand"), options, fresh()); }));
  options.threads = 1;
  options.minibatches = 1;
  EXPECT_NO_THROW(Ppo(g1(), wbc_stage("stand"), options, fresh()));
  options.threads = 0;
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { Ppo(g1(), wbc_stage("stand"), options, fresh()); }));
}

TEST_F(TrainingStateInMujoco, IsTheSameAfterTheFile) {
  Ppo ppo(g1(), wbc_stage("stand"), small(), fresh());
  ppo.iterate();
  const TrainingState& state = ppo.state();
  const TrainingState read = training_state(to_tensors(state), "x");
  EXPECT_EQ(read.agent.actor.layers[2].W, state.agent.actor.layers[2].W);
  EXPECT_EQ(read.agent.critic_input.variance, state.agent.critic_input.variance);
  EXPECT_EQ(read.adam.m.back(), state.adam.m.back());
  EXPECT_EQ(read.adam.steps, state.adam.steps);
  EXPECT_EQ(read.steps, state.steps);
  EXPECT_EQ(read.robot_digest, state.robot_digest);
}

TEST(TrainingState, WhatIsMissingIsNamed) {
  SafeTensors tensors = to_tensors(fresh());
  tensors.tensors.erase("critic_input.mean");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { training_state(tensors, "a.safetensors"); }));
  tensors = to_tensors(fresh());
  tensors.metadata["format"] = "other";
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { training_state(tensors, "a"); }));
}

TEST_F(DistillationInMujoco, TheLossFallsAndTheSeedDecides) {
  DistillOptions options;
  options.environments = 4;
  options.buffer = 256;
  options.batch = 64;
  options.warm_rounds = 100;  // the oracle acts: the same states for both students
  WbcTask task = wbc_stage("stand");
  Distillation a(g1(), task, options, fresh().agent, make_student(29, 1), 40);
  Distillation b(g1(), task, options, fresh().agent, make_student(29, 1), 40);
  double first = 0.0, last = 0.0;
  for (int i = 0; i < 20; ++i) {
    const double loss = a.iterate().loss;
    EXPECT_EQ(loss, b.iterate().loss);
    if (i == 0) first = loss;
    last = loss;
  }
  EXPECT_LT(last, 0.7 * first);
}

}  // namespace
}  // namespace duet
