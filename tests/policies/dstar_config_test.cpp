#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "duet/core/require.h"
#include "duet/policies/dstar/features.h"
#include "duet/policies/dstar/network.h"
#include "tests/policies/dstar_fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::ElementsAre;
using ::testing::StartsWith;

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

}  // namespace
}  // namespace duet
