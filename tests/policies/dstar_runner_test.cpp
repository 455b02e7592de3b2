#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "duet/core/require.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/dstar/features.h"
#include "duet/policies/dstar/network.h"
#include "duet/policies/dstar/retrieval.h"
#include "duet/robots/robot_model.h"
#include "tests/backends/allocation_count.h"
#include "tests/policies/dstar_fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::random_network;
using test::random_sample;
using test::small_config;
using test::thrown_message;
using ::testing::ElementsAre;
using ::testing::StartsWith;

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

// The refusal of the default configuration with one field set to another value; null takes it away.
std::string refusal(const std::string& field, const nlohmann::json& value) {
  nlohmann::json json = nlohmann::json::parse(to_json_text({}));
  if (value.is_null())
    json.erase(field);
  else
    json[field] = value;
  return thrown_message<InputError>([&] { parse_dstar_config(json.dump(), "net"); });
}

TEST(DstarConfig, IsReadBackAsWritten) {
  EXPECT_EQ(parse_dstar_config(to_json_text({}), "net"), DstarConfig());
  DstarConfig config = test::small_config();
  config.spatial_reasoning = config.language_on = false;
  EXPECT_EQ(parse_dstar_config(to_json_text(config), "net"), config);
  EXPECT_THAT(to_json_text({}), StartsWith(R"({"long_frames":12,"short_frames":6,"long_stride":20,"width":128,)"));
}

TEST(DstarConfig, HasThePapersConditionOf1408) {
  DstarConfig config;
  EXPECT_EQ(config.condition_inputs(), 1408);
  config.phase_attention = config.spatial_reasoning = false;
  EXPECT_EQ(config.condition_inputs(), 1024);
}

TEST(DstarConfig, RefusesOtherFieldsAndValues) {
  const std::string start = "net: configuration of D-STAR: ";
  EXPECT_EQ(thrown_message<InputError>([] { parse_dstar_config("[1]", "net"); }),
            start + "expected a JSON object, found array");
  EXPECT_SENTENCE(thrown_message<InputError>([] { parse_dstar_config("{", "net"); }));
  EXPECT_SENTENCE(refusal("widht", 3));
  EXPECT_EQ(refusal("width", {}), start + "expected a field 'width', found none");
  EXPECT_EQ(refusal("short_stream", {}), start + "expected a field 'short_stream', found none");
  EXPECT_EQ(refusal("width", 0), start + "'width': expected a whole number from 1 to 8192, found 0");
  EXPECT_EQ(refusal("width", 128.5), start + "'width': expected a whole number from 1 to 8192, found 128.5");
  EXPECT_EQ(refusal("width", "128"), start + "'width': expected a whole number from 1 to 8192, found \"128\"");
  EXPECT_EQ(refusal("width", 1e30), start + "'width': expected a whole number from 1 to 8192, found 1e+30");
  EXPECT_EQ(refusal("long_frames", 13), start + "'long_frames': expected a whole number from 1 to 12, found 13");
  EXPECT_EQ(refusal("language_on", 1), start + "'language_on': expected true or false, found 1");
}

TEST(DstarConfig, RefusesSizesThatDoNotDivide) {
  const std::string start = "net: configuration of D-STAR: ";
  EXPECT_EQ(refusal("heads", 3), start + "'width': expected a multiple of 'heads' (3), found 128");
  EXPECT_EQ(refusal("tokens", 7), start + "'temporal': expected a multiple of 'tokens' (7), found 256");
  EXPECT_EQ(refusal("field", 126), start + "'field': expected a multiple of 'fusion_heads' (4), found 126");
  EXPECT_EQ(refusal("groups", 5), start + "'channels': expected a multiple of 'groups' (5), found 168");
  EXPECT_EQ(refusal("step_embedding", 63), start + "'step_embedding': expected an even number, found 63");
  EXPECT_EQ(refusal("inference_steps", 51),
            start + "'inference_steps': expected at most 'training_steps' (50), found 51");
}

TEST(Diffusion, ScheduleIsTheSquaredCosineUpToTheBoundOnBeta) {
  const auto f = [](double x) { return std::pow(std::cos((x + 0.008) / 1.008 * std::numbers::pi / 2.0), 2); };
  const std::vector<double> alpha_bar = squared_cosine_alpha_bar(50);
  ASSERT_EQ(alpha_bar.size(), 50U);
  for (int t = 0; t < 49; ++t) EXPECT_NEAR(alpha_bar[t], f((t + 1) / 50.0) / f(0.0), 1e-13) << t;
  EXPECT_NEAR(alpha_bar[49], 0.001 * alpha_bar[48], 1e-15);
  EXPECT_NEAR(alpha_bar[24], 0.4938, 1e-4);
}

TEST(Diffusion, InferenceGoesFromTheLastStepToTheFirst) {
  EXPECT_THAT(ddim_steps(50, 10), ElementsAre(49, 44, 38, 33, 27, 22, 16, 11, 5, 0));
  EXPECT_THAT(ddim_steps(50, 1), ElementsAre(49));
  EXPECT_THAT(ddim_steps(3, 3), ElementsAre(2, 1, 0));
  EXPECT_THAT(ddim_steps(1, 1), ElementsAre(0));
}

TEST(Diffusion, RefusesNoStepsAndMoreThanThereAre) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { squared_cosine_alpha_bar(0); }));
  for (const int steps : {0, 6}) EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { ddim_steps(5, steps); }));
}

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
