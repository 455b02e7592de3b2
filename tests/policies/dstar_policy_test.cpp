#include "duet/policies/dstar/dstar_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/policy.h"
#include "duet/policies/scheduler.h"
#include "tests/policies/dstar_fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::thrown_message;
using ::testing::ElementsAre;

DstarConfig policy_config() {
  DstarConfig config = test::small_config();
  config.language = kLanguageSize;
  return config;
}

std::unique_ptr<Policy> make(const DstarSampling& sampling = {.temperature = 1.0}) {
  static const auto network = test::random_network(policy_config());
  return make_dstar_policy("dstar", g1(), network, built_in_language(), sampling);
}

// The standing robot with somebody about a metre in front of it, who waves as time goes by.
ObservationFrame frame_at(int tick) {
  ObservationFrame frame;
  frame.robot = g1()->standing_state();
  for (int j = 0; j < kSmplJoints; ++j)
    frame.partner.col(j) = Eigen::Vector3d(1.0 + 0.01 * j, 0.1 * std::sin(j + 0.1 * tick), 0.3 + 0.05 * j);
  return frame;
}

EpisodeContext context_of(std::uint64_t seed, const std::string& prompt = "") {
  EpisodeContext context;
  context.seed = seed;
  context.prompt = prompt;
  context.start = g1()->standing_state();
  return context;
}

// Joint angles of every fourth reference of a second's plans.
std::vector<double> episode(Policy& policy, const EpisodeContext& context) {
  policy.reset(context);
  ObservationHistory history;
  history.reset();
  std::vector<double> numbers;
  for (int tick = 0; tick < 50; ++tick) {
    history.add(frame_at(tick));
    if (tick % kTicksPerPlan != 0) continue;
    const std::vector<Reference> plan = policy.plan(history.at(tick));
    EXPECT_EQ(plan.size(), 100U);
    for (const Reference& reference : plan) {
      numbers.insert(numbers.end(), reference.q.begin(), reference.q.end());
      numbers.insert(numbers.end(), reference.X_WB.p.begin(), reference.X_WB.p.end());
    }
  }
  EXPECT_FALSE(policy.faults().any());
  return numbers;
}

TEST(DstarPolicy, RepeatsAnEpisodeToTheBit) {
  const auto policy = make(), other = make();
  const std::vector<double> first = episode(*policy, context_of(1));
  EXPECT_EQ(episode(*policy, context_of(1)), first);
  EXPECT_EQ(episode(*other, context_of(1)), first);
  EXPECT_NE(episode(*policy, context_of(2)), first);
  const auto fresh = make({.noise = NoiseMode::kCall, .temperature = 1.0});
  const std::vector<double> by_call = episode(*fresh, context_of(1));
  EXPECT_EQ(episode(*fresh, context_of(1)), by_call);
  EXPECT_NE(by_call, first);
}

bool same_joints(const std::vector<Reference>& a, const std::vector<Reference>& b) {
  return a.size() == b.size() && a.front().q == b.front().q && a.back().q == b.back().q;
}

TEST(DstarPolicy, KeepsItsNoiseForTheEpisodeOrDrawsItByCall) {
  ObservationHistory history;
  history.reset();
  history.add(frame_at(0));
  for (const NoiseMode mode : {NoiseMode::kEpisode, NoiseMode::kCall}) {
    const auto policy = make({.noise = mode, .temperature = 1.0});
    policy->reset(context_of(1));
    const std::vector<Reference> first = policy->plan(history.at(0)), second = policy->plan(history.at(0));
    EXPECT_EQ(same_joints(first, second), mode == NoiseMode::kEpisode);
  }
}

TEST(DstarPolicy, DrawsByCallOnlyWhereItIsToldToBeginIfAskedTo) {
  const std::string first = leading_prompt(task_prompt(Task::kHug));
  const auto lead = make({.noise = NoiseMode::kLead, .temperature = 0.5}), still = make({.temperature = 0.0}),
             by_call = make({.noise = NoiseMode::kCall, .temperature = 0.5});
  EXPECT_EQ(episode(*lead, context_of(1)), episode(*still, context_of(1)));
  EXPECT_EQ(episode(*lead, context_of(1, first)), episode(*by_call, context_of(1, first)));
  EXPECT_NE(episode(*lead, context_of(1, first)), episode(*still, context_of(1, first)));
}

TEST(DstarPolicy, WithoutTemperatureItsSeedDoesNotMatter) {
  const auto still = make({.temperature = 0.0}), half = make({.temperature = 0.5});
  const std::vector<double> first = episode(*still, context_of(1));
  EXPECT_EQ(episode(*still, context_of(2)), first);
  EXPECT_NE(episode(*half, context_of(1)), episode(*half, context_of(2)));
}

// One plan at the end of a time in which the partner waved, or did not.
std::vector<Reference> plan_after(Policy& policy, bool waved) {
  policy.reset(context_of(1));
  ObservationHistory history;
  history.reset();
  std::vector<Reference> plan;
  for (int tick = 0; tick <= 200; ++tick) {
    history.add(frame_at(waved && tick < 150 ? tick : 0));
    if (tick % kTicksPerPlan == 0) plan = policy.plan(history.at(tick));
  }
  return plan;
}

TEST(DstarPolicy, RemembersWhatItsLongStreamLooksBackOn) {
  DstarConfig config = policy_config();
  for (const int stride : {1, 20}) {
    config.long_stride = stride;
    const auto policy = make_dstar_policy("dstar", g1(), test::random_network(config), built_in_language());
    EXPECT_EQ(same_joints(plan_after(*policy, true), plan_after(*policy, false)), stride == 1);
  }
}

TEST(DstarPolicy, HeedsThePromptAndElseTheTask) {
  const auto policy = make();
  const std::vector<double> hug = episode(*policy, context_of(1));
  EXPECT_EQ(episode(*policy, context_of(1, std::string(task_prompt(Task::kHug)))), hug);
  EXPECT_NE(episode(*policy, context_of(1, "wave at the person")), hug);
  EpisodeContext wave = context_of(1);
  wave.task = Task::kWave;
  EXPECT_NE(episode(*policy, wave), hug);
  EXPECT_THROW(policy->reset(context_of(1, "?")), std::invalid_argument);
}

TEST(DstarPolicy, BeginsOnCommandWhereItLearntToAndElseAnswers) {
  const std::string first = leading_prompt(task_prompt(Task::kHug));
  DstarNetwork network = random_dstar_network(policy_config(), *g1(), 1);
  const auto told = [&](const std::string& prompt) {
    return episode(
        *make_dstar_policy("dstar", g1(), std::make_shared<const DstarNetwork>(network), built_in_language()),
        context_of(1, prompt));
  };
  EXPECT_EQ(told(first), told(""));
  network.notes[kBegins] = "half of the gestures";
  EXPECT_NE(told(first), told(""));
}

TEST(DstarPolicy, LeavesOutAPlanOfWhatIsNotANumberAndGoesOn) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  const auto policy = make();
  policy->reset(context_of(1));
  int invalid = 0;
  const std::vector<std::function<void(ObservationFrame&)>> faults = {
      [&](ObservationFrame& frame) { frame.partner(2, 20) = nan; },
      [&](ObservationFrame& frame) { frame.robot.q[4] = nan; },
      [&](ObservationFrame& frame) { frame.robot.v[4] = infinity; }};
  for (const auto& fault : faults) {
    ObservationHistory history;
    history.reset();
    ObservationFrame frame = frame_at(0);
    fault(frame);
    history.add(frame);
    EXPECT_TRUE(policy->plan(history.at(20)).empty());
    EXPECT_EQ(policy->faults().invalid, ++invalid);
  }
  EXPECT_SENTENCE(policy->faults().message);
  ObservationHistory history;
  history.reset();
  history.add(frame_at(0));
  EXPECT_EQ(policy->plan(history.at(30)).size(), 100U);
  EXPECT_EQ(policy->faults().invalid, invalid);
  policy->reset(context_of(1));
  EXPECT_FALSE(policy->faults().any());
}

TEST(DstarPolicy, LeavesOutAPlanThatItsNetworkSpoils) {
  DstarNetwork network = *test::random_network(policy_config());
  for (float& value : network.weights["denoise.in.weight"].values) value = 1e38F;
  const auto policy =
      make_dstar_policy("dstar", g1(), std::make_shared<const DstarNetwork>(network), built_in_language());
  policy->reset(context_of(1));
  ObservationHistory history;
  history.reset();
  history.add(frame_at(0));
  EXPECT_TRUE(policy->plan(history.at(0)).empty());
  EXPECT_EQ(policy->faults().invalid, 1);
  EXPECT_SENTENCE(policy->faults().message);
}

TEST(DstarPolicy, ComesByItsNameWithANetworkOfItsOwn) {
  const test::ScratchFolder folder;
  const std::string path = folder / "net.safetensors";
  save_dstar_network(path, *test::random_network(policy_config()), TensorType::kF16);
  for (const std::string name : {"dstar", "dp"}) {
    const PolicyMaker maker = policy_maker(name, g1(), {{"network", path}});
    const auto policy = maker(), other = maker();
    EXPECT_EQ(policy->name(), name);
    EXPECT_EQ(episode(*policy, context_of(1)), episode(*other, context_of(1)));
    const PolicyOptions noisy = {{"network", path}, {"noise", "call"}, {"temperature", "1"}};
    EXPECT_NE(episode(*make_policy(name, g1(), noisy), context_of(1)), episode(*policy, context_of(1)));
  }
}

TEST(DstarPolicy, ShipsANetworkOfEachForEitherNetworkOfWbcSimAndTakesBraced) {
  for (const std::string name : {"dstar", "dp"}) {
    const auto file = [&](const PolicyOptions& options) { return dstar_files(name, options).at(0).path; };
    const std::string student = file({{"network", "student"}});
    EXPECT_THAT(student, testing::EndsWith("/" + name + ".safetensors"));
    EXPECT_EQ(file({}), student.substr(0, student.rfind(".safetensors")) + "_braced.safetensors");
    EXPECT_EQ(file({{"network", "braced"}}), file({}));
    for (const char* network : {"braced", "student"}) EXPECT_NO_THROW(make_policy(name, g1(), {{"network", network}}));
  }
}

TEST(DstarPolicy, RefusesWhatItCannotRun) {
  const auto refusal = [](const PolicyOptions& options) {
    return thrown_message<std::invalid_argument>([&] { make_policy("dstar", g1(), options); });
  };
  EXPECT_SENTENCE(refusal({{"noise", "cal"}}));
  EXPECT_SENTENCE(refusal({{"temperature", "1.5"}}));
  EXPECT_SENTENCE(refusal({{"netwrok", "x"}}));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { make_policy("dstar", nullptr); }));
  EXPECT_SENTENCE(thrown_message<MissingError>([] { make_policy("dstar", g1(), {{"network", "/none.safetensors"}}); }));
  EXPECT_SENTENCE(thrown_message<MissingError>([] { make_policy("dp", g1(), {{"language", "/none.npz"}}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { make()->act({}); }));
}

TEST(DstarPolicy, RefusesAnotherLanguageThanItsNetworks) {
  const auto message = [](const DstarConfig& config, const std::string& language) {
    DstarNetwork network = *test::random_network(config);
    network.language = language;
    return thrown_message<std::invalid_argument>(
        [&] { make_dstar_policy("dstar", g1(), std::make_shared<const DstarNetwork>(network), built_in_language()); });
  };
  EXPECT_SENTENCE(message(policy_config(), "clip"));
  EXPECT_SENTENCE(message(test::small_config(), "duet-text-1"));
  DstarConfig silent = test::small_config();
  silent.language_on = false;
  EXPECT_EQ(message(silent, "clip"), "(nothing was thrown)");
}

// A frame that says when it was seen.
ObservationFrame frame_of_tick(int tick) {
  ObservationFrame frame;
  frame.partner.setConstant(tick);
  return frame;
}

std::vector<int> ticks_of(PastFrames& past) {
  std::vector<int> ticks;
  for (const ObservationFrame& frame : past.frames()) ticks.push_back(static_cast<int>(frame.partner(0, 0)));
  return ticks;
}

// The ticks that are looked back on at `tick`, with an observation every `every` ticks from 0.
std::vector<int> seen_at(int tick, int stride, int every) {
  PastFrames past(stride);
  ObservationHistory history;
  for (int t = 0; t <= tick; ++t) {
    history.add(frame_of_tick(t));
    if (t % every == 0) past.add(history.at(t));
  }
  return ticks_of(past);
}

TEST(PastFrames, AreTheStrideApart) {
  EXPECT_THAT(seen_at(300, 20, 10), ElementsAre(80, 100, 120, 140, 160, 180, 200, 220, 240, 260, 280, 300));
  EXPECT_THAT(seen_at(300, 7, 10), ElementsAre(223, 230, 237, 244, 251, 258, 265, 272, 279, 286, 293, 300));
  EXPECT_THAT(seen_at(300, 1, 10), ElementsAre(289, 290, 291, 292, 293, 294, 295, 296, 297, 298, 299, 300));
}

TEST(PastFrames, BeforeTheFirstAreTheFirst) {
  EXPECT_THAT(seen_at(40, 20, 10), ElementsAre(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 20, 40));
}

TEST(PastFrames, OfTicksNotSeenAreTheLastOnesBefore) {
  // Observations at 0, 50, 100 bring the ticks 0, 39 to 50 and 89 to 100.
  EXPECT_THAT(seen_at(100, 8, 50), ElementsAre(0, 0, 0, 0, 44, 50, 50, 50, 50, 50, 92, 100));
}

TEST(PastFrames, AnObservationReplacesWhatWasSeenOfItsTicks) {
  PastFrames past(1);
  ObservationHistory history;
  history.add(frame_of_tick(3));
  past.add(history.at(5));
  history.reset();
  history.add(frame_of_tick(4));
  past.add(history.at(5));
  EXPECT_THAT(ticks_of(past), ::testing::Each(4));
  past.reset();
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { past.frames(); }));
}

}  // namespace
}  // namespace duet
