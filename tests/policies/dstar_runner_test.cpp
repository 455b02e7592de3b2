#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "duet/policies/dstar/network.h"
#include "tests/backends/allocation_count.h"
#include "tests/policies/dstar_fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::random_network;
using test::random_sample;
using test::small_config;
using test::thrown_message;

// Tolerance relative to a plan's largest number: a few hundred roundings of float on the way through ten steps.
constexpr double kRelative = 1e-5;

double error_of(std::span<const float> found, const Eigen::VectorXd& expected) {
  const Eigen::Map<const Eigen::VectorXf> values(found.data(), static_cast<Eigen::Index>(found.size()));
  return (values.cast<double>() - expected).cwiseAbs().maxCoeff() / expected.cwiseAbs().maxCoeff();
}

void expect_as_in_double_precision(const DstarConfig& config, std::uint64_t seed) {
  const auto network = random_network(config, seed);
  const test::DstarSample sample = random_sample(config, seed);
  const test::DstarExpected expected = test::evaluate_plainly(*network, sample);
  DstarRunner runner(network);
  const std::span<const float> plan = runner.run(sample.input());
  EXPECT_LT(error_of(plan, expected.plan), kRelative);
  EXPECT_LT(error_of(runner.normalised_plan(), expected.normalised_plan), kRelative);
  ASSERT_EQ(runner.phases().size(), config.phase_attention ? kPhases : 0);
  if (config.phase_attention) {
    EXPECT_LT(error_of(runner.phases(), expected.phases), kRelative);
  }
}

TEST(DstarRunner, AgreesWithDoublePrecisionInEveryAblation) {
  for (int bits = 0; bits < 16; ++bits) {
    DstarConfig config = small_config();
    config.phase_attention = (bits & 1) == 0;
    config.spatial_reasoning = (bits & 2) == 0;
    config.short_stream = (bits & 4) == 0;
    config.language_on = (bits & 8) == 0;
    SCOPED_TRACE(bits);
    expect_as_in_double_precision(config, 10 + bits);
  }
}

// Every width as it ships; fewer blocks and steps, for a quick test.
DstarConfig wide_config() {
  DstarConfig config;
  config.blocks = 2;
  config.inference_steps = 3;
  return config;
}

TEST(DstarRunner, AgreesWithDoublePrecisionInTheWidthsThatShip) { expect_as_in_double_precision(wide_config(), 3); }

TEST(DstarRunner, AgreesWithDoublePrecisionInOneStepAndInAllSteps) {
  DstarConfig config = small_config();
  config.inference_steps = 1;
  expect_as_in_double_precision(config, 4);
  config.inference_steps = config.training_steps;
  expect_as_in_double_precision(config, 5);
}

TEST(DstarRunner, RemembersNothing) {
  const auto network = random_network(small_config());
  const test::DstarSample a = random_sample(network->config, 1), b = random_sample(network->config, 2);
  DstarRunner runner(network);
  const std::span<const float> plan = runner.run(a.input());
  const std::vector<float> first(plan.begin(), plan.end());
  runner.run(b.input());
  EXPECT_NE(std::vector<float>(plan.begin(), plan.end()), first);
  runner.run(a.input());
  EXPECT_EQ(std::vector<float>(plan.begin(), plan.end()), first);
}

TEST(DstarRunner, DoesNotHideWhatIsNotANumber) {
  const auto network = random_network(small_config());
  DstarRunner runner(network);
  const auto all_nan = [&](const test::DstarSample& sample) {
    for (const float value : runner.run(sample.input()))
      if (!std::isnan(value)) return false;
    return true;
  };
  const test::DstarSample good = random_sample(network->config, 1);
  EXPECT_FALSE(all_nan(good));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  test::DstarSample bad = good;
  bad.features.frames(3, kHistoryFrames - 1) = nan;
  EXPECT_TRUE(all_nan(bad));
  bad = good;
  bad.features.distance[2] = nan;
  EXPECT_TRUE(all_nan(bad));
  bad = good;
  bad.language[1] = nan;
  EXPECT_TRUE(all_nan(bad));
  EXPECT_FALSE(all_nan(good));
}

TEST(DstarRunner, DoesNotAllocate) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer has its own malloc";
  const auto network = random_network(wide_config());
  const test::DstarSample sample = random_sample(network->config, 1);
  DstarRunner runner(network);
  const long before = test::allocation_count();
  runner.run(sample.input());
  EXPECT_EQ(test::allocation_count() - before, 0);
}

TEST(DstarRunner, RefusesWhatDoesNotFit) {
  const auto message = [](const DstarInput& input) {
    DstarRunner runner(random_network(small_config()));
    return thrown_message<std::invalid_argument>([&] { runner.run(input); });
  };
  const test::DstarSample sample = random_sample(small_config(), 1);
  DstarInput input = sample.input();
  input.features = nullptr;
  EXPECT_SENTENCE(message(input));
  input = sample.input();
  input.noise = input.noise.first(10);
  EXPECT_SENTENCE(message(input));
  input = sample.input();
  input.language = input.language.first(3);
  EXPECT_SENTENCE(message(input));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { DstarRunner runner(nullptr); }));
  DstarNetwork broken = *random_network(small_config());
  broken.weights.erase("temporal.bias");
  EXPECT_SENTENCE(
      thrown_message<std::invalid_argument>([&] { DstarRunner runner(std::make_shared<const DstarNetwork>(broken)); }));
}

}  // namespace
}  // namespace duet
