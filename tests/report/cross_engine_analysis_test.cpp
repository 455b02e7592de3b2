#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "duet/report/engines/cross_engine.h"
#include "duet/report/page/run_analyses.h"
#include "tests/report/estimates.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::engine_episode;
using test::estimate;
using test::traced;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// Three engines and playback, two policies, six episodes of two clips each.
std::vector<EpisodeRow> benchmark() {
  struct Engine {
    const char* name;
    int a, b;  // successes of six
    double drift;
    int parts_at;
    double force;
  };
  std::vector<EpisodeRow> rows;
  for (const Engine& engine : {Engine{"mujoco", 6, 3, 0.01, 9, 100.0}, Engine{"bullet", 5, 4, 0.02, 5, 120.0},
                               Engine{"ode", 2, 3, 0.05, 2, 80.0}, Engine{"playback", 6, 6, 0.0, 9, 0.0}}) {
    for (int i = 0; i < 12; ++i) {
      const bool second = i >= 6;
      EpisodeRow row =
          engine_episode(engine.name, second ? "diffuse" : "replay", i % 6, i % 6 < (second ? engine.b : engine.a));
      row.metrics = {{"jpe", 0.1 + engine.drift}};
      row.trace.points = {"root"};
      for (int frame = 0; frame < 8; ++frame) row.trace.mm.push_back({frame >= engine.parts_at ? 100 : 0, 0, 0});
      if (engine.force > 0.0) row.forces = {{"human.peak_n", engine.force}};
      rows.push_back(row);
    }
  }
  return rows;
}

CrossEngine compared(const std::vector<EpisodeRow>& rows) {
  return cross_engine(rows, {{"jpe", "Joint position error", "m", "lower"}, {"awd", "AWD", "m", "lower"}},
                      {.intervals = {.resamples = 1000}});
}

TEST(CrossEngineMarkdown, IsAsBlessed) {
  EXPECT_EQ(analysis_markdown(engine_analysis(compared(benchmark()))), R"md(### Success per engine

Controller vmc, perturbation clean.

| Policy  |   n |            bullet |              mujoco |              ode |            playback |
| :------ | --: | ----------------: | ------------------: | ---------------: | ------------------: |
| diffuse |   6 | 66.7 [15.9, 95.5] |    50.0 [9.5, 90.5] | 50.0 [9.5, 90.5] | 100.0 [34.2, 100.0] |
| replay  |   6 | 83.3 [24.1, 98.7] | 100.0 [34.2, 100.0] | 33.3 [4.5, 84.1] | 100.0 [34.2, 100.0] |

Success in % of the episodes that all engines of the row ran, with 95 % Wilson intervals. Playback has no physics and is in no mean.

### Spread between engines

Controller vmc, perturbation clean.

| Policy  | Engines |              Mean |   SD | Range | Noise SD | Beyond noise |
| :------ | ------: | ----------------: | ---: | ----: | -------: | -----------: |
| diffuse |       3 | 55.6 [11.4, 92.4] |  9.6 |  16.7 |     21.9 |          0.0 |
| replay  |       3 | 72.2 [18.5, 96.8] | 34.7 |  66.7 |     15.5 |         31.0 |

Mean over engines in %, each engine counting the same. Its 95 % interval is Wilson's over clips, however many engines run them: it covers which clips were taken, not which engines; those are the ones at hand.
In points: SD, the sample standard deviation of the engines' rates; range, the highest minus the lowest; noise SD, what chance in so many episodes gives if engines do not differ; beyond noise, the SD that is left when chance is taken off (tau by the method of moments, not below 0). Engines share their episodes, so chance is smaller than assumed and what is left errs low.

### Stability of ranks

| Engines        | tau-b of combinations | Swapped |
| :------------- | --------------------: | ------: |
| bullet, mujoco |                  1.00 |  0 of 1 |
| bullet, ode    |                 -1.00 |  1 of 1 |
| mujoco, ode    |                 -1.00 |  1 of 1 |

Ranks of combinations: mean tau-b -0.33 over 3 pairs of engines; 1 of 1 pairs swap their order between some two engines.
Of combinations, with intervals that draw clips again: mean tau-b -0.33 [-0.33, 1.00]; mean maximum rank violation 16.7 points [5.6, 16.7]; 0.67 of the pairs of engines have no winner in common [0.00, 0.67].
By success; combinations are of controller and policy. tau-b (Kendall): 1 the same order in both engines, 0 none in common, -1 the reverse; not defined where all are tied. Swapped: pairs in opposite order in the two engines.

### Drift of metrics from playback

Controller vmc.

| Metric               | Unit | Pairs | playback |             bullet |             mujoco |                ode |
| :------------------- | :--- | ----: | -------: | -----------------: | -----------------: | -----------------: |
| Joint position error | m    |    12 |      0.1 | +0.02 [0.02, 0.02] | +0.01 [0.01, 0.01] | +0.05 [0.05, 0.05] |

Mean of engine minus playback over the same episodes, with a 95 % interval that draws clips again. Playback: its own mean.

### Time until engines part

| Engines        | Episodes | First quartile [s] | Median [s] | Third quartile [s] | Never part [%] |
| :------------- | -------: | -----------------: | ---------: | -----------------: | -------------: |
| bullet, mujoco |       12 |               0.50 |       0.50 |               0.50 |            0.0 |
| bullet, ode    |       12 |               0.20 |       0.20 |               0.20 |            0.0 |
| mujoco, ode    |       12 |               0.20 |       0.20 |               0.20 |            0.0 |

First time at which a traced point (root, hands) is more than 5 cm away from where it is in the other engine in the same episode, or at which the robot falls or diverges in one engine alone. Quartiles by Kaplan and Meier: an episode that ends before that counts for as long as it lasted.

### Agreement of contact forces

| Force        | Unit | Episodes | Typical | Spread [%] | bullet | mujoco |   ode |
| :----------- | :--- | -------: | ------: | ---------: | -----: | -----: | ----: |
| human.peak_n | N    |       12 |     100 |       40.0 |  1.200 |  1.000 | 0.800 |

Medians over the episodes in which some engine has the force. Typical: the engines' median. Spread: highest minus lowest over the mean of the engines. Below an engine: its force over the engines' median.

### Parity certificate

No parity certificate is attached (duet validate makes one).
)md");
}

TEST(CrossEngineMarkdown, IsOneLineForOneEngine) {
  std::vector<EpisodeRow> rows = benchmark();
  std::erase_if(rows, [](const EpisodeRow& row) { return row.engine == "ode" || row.engine == "bullet"; });
  EXPECT_EQ(analysis_markdown(engine_analysis(compared(rows))),
            "Nothing to compare across engines: these results have one physics engine, mujoco.\n");
  EXPECT_EQ(analysis_markdown(engine_analysis(compared({}))),
            "Nothing to compare across engines: these results have no physics engine.\n");
}

TEST(CrossEngineMarkdown, SaysWhatIsMissing) {
  std::vector<EpisodeRow> rows = benchmark();
  std::erase_if(rows, [](const EpisodeRow& row) { return row.engine == "playback" || row.policy == "diffuse"; });
  rows.erase(rows.begin());
  for (EpisodeRow& row : rows) {
    row.trace.mm.clear();
    row.forces.clear();
  }
  EXPECT_THAT(analysis_markdown(engine_analysis(compared(rows))),
              AllOf(HasSubstr("Ranks of combinations: not defined with fewer than two of them."),
                    HasSubstr("1 episodes that only some of the engines ran are left out"),
                    HasSubstr("No episode was also run by the engine playback"),
                    HasSubstr("No episode has traces of two engines that can be compared."),
                    HasSubstr("No episode has a contact force in two engines."), Not(HasSubstr("nan")),
                    Not(HasSubstr("Playback has no physics"))));
}

TEST(CrossEngineMarkdown, TiesThroughoutAreNotDefined) {
  std::vector<EpisodeRow> rows = benchmark();
  for (EpisodeRow& row : rows) row.success = true;
  EXPECT_SENTENCE(analysis_markdown(engine_analysis(compared(rows))));
}

TEST(CrossEngineMarkdown, SeveralControllersHaveColumnsAndDriftsOfTheirOwn) {
  std::vector<EpisodeRow> rows = benchmark();
  for (const EpisodeRow& row : benchmark()) {
    if (row.engine == "playback") continue;
    rows.push_back(row);
    rows.back().controller = "wbc";
  }
  EXPECT_SENTENCE(analysis_markdown(engine_analysis(compared(rows))));
}

TEST(CrossEngineFigures, AreOfEnginesPairsOfEnginesAndAllOfThem) {
  const Analysis analysis = engine_analysis(compared(benchmark()));
  const Estimate rate =
      estimate(analysis, {.engine = "mujoco", .policy = "diffuse", .perturbation = "clean", .name = "success"});
  EXPECT_EQ(rate.n, 6);
  EXPECT_EQ(rate.k, 3);
  EXPECT_EQ(rate.value, 0.5);
  EXPECT_EQ(estimate(analysis, {.engine = "playback", .policy = "replay", .name = "success"}).value, 1.0);
  EXPECT_EQ(estimate(analysis, {.engine = "all", .policy = "replay", .name = "mean_success"}).n, 6);
  const Estimate tau = estimate(analysis, {.engine = "bullet vs mujoco", .of = "combinations", .name = "tau_b"});
  EXPECT_EQ(tau.n, 2);
  EXPECT_EQ(tau.value, 1.0);
  EXPECT_EQ(estimate(analysis, {.engine = "all", .of = "combinations", .name = "swapped"}).value, 1.0);
  EXPECT_EQ(estimate(analysis, {.engine = "ode", .of = "jpe", .name = "drift"}).unit, "m");
  EXPECT_NEAR(estimate(analysis, {.engine = "ode", .of = "jpe", .name = "drift"}).value, 0.05, 1e-12);
  EXPECT_EQ(estimate(analysis, {.engine = "bullet vs ode", .name = "parting_median"}).value, 0.2);
  EXPECT_EQ(estimate(analysis, {.engine = "ode", .of = "human.peak_n", .name = "force_ratio"}).value, 0.8);
  EXPECT_EQ(estimate(analysis, {.engine = "all", .of = "human.peak_n", .name = "typical_force"}).unit, "N");
}

TEST(CrossEngineFigures, WhatIsNotDefinedIsNoNumber) {
  std::vector<EpisodeRow> rows = benchmark();
  for (EpisodeRow& row : rows) row.success = true;
  EXPECT_TRUE(std::isnan(
      estimate(engine_analysis(compared(rows)), {.engine = "all", .of = "combinations", .name = "mean_tau_b"}).value));
}

TEST(CrossEngineFigures, ACertificateIsShownOfOneEngineToo) {
  std::vector<EpisodeRow> rows = benchmark();
  std::erase_if(rows, [](const EpisodeRow& row) { return row.engine != "mujoco"; });
  EXPECT_TRUE(engine_analysis(compared(rows)).empty());
  const Analysis certified = engine_analysis(compared(rows), {{"engines", {{{"name", "mujoco"}, {"passed", 20}}}}});
  EXPECT_FALSE(certified.empty());
  EXPECT_EQ(certified.tables.back().title, "Parity certificate");
}

TEST(EnginePlot, HasALinePerEngineAndABarForTheMean) {
  std::vector<EpisodeRow> rows = benchmark();
  for (EpisodeRow& row : rows) {
    if (row.engine == "ode") row.engine = "o<d>e";
  }
  const std::string svg = engine_plot_svg(compared(rows));
  EXPECT_THAT(svg, AllOf(StartsWith("<svg xmlns="), HasSubstr(">replay</text>"), HasSubstr("o&lt;d&gt;e"),
                         HasSubstr("prefers-color-scheme:dark"), HasSubstr(">mean 72.2 ["), Not(HasSubstr("nan"))));
  const auto count = [&](const std::string& piece) {
    std::size_t found = 0;
    for (std::size_t at = svg.find(piece); at != std::string::npos; at = svg.find(piece, at + 1)) ++found;
    return found;
  };
  EXPECT_EQ(count("<circle class=\"d\""), 6U);
  EXPECT_EQ(count("<circle class=\"h\""), 2U);  // playback
  EXPECT_EQ(count("<line class=\"m\""), 2U);
  EXPECT_THAT(engine_plot_svg({}), testing::EndsWith("</svg>\n"));
}

// Numbers after `name` ("width=\"") in the order in which they occur.
std::vector<double> numbers_after(const std::string& text, const std::string& name) {
  std::vector<double> values;
  for (std::size_t at = text.find(name); at != std::string::npos; at = text.find(name, at + 1))
    values.push_back(std::stod(text.substr(at + name.size())));
  return values;
}

TEST(EnginePlot, HasRoomForTheWidestRate) {
  std::vector<EpisodeRow> rows = benchmark();
  for (EpisodeRow& row : rows) row.success = true;  // two clips
  const std::string svg = engine_plot_svg(compared(rows));
  const std::size_t label = svg.find(">mean 100.0 [34.2, 100.0]<");
  ASSERT_NE(label, std::string::npos);
  const double left = numbers_after(svg.substr(svg.rfind("<text", label)), "x=\"").front();
  constexpr double kWidestCharacter = 7.4;  // of common fonts at 13 px, digits [px]
  EXPECT_GE(numbers_after(svg, "width=\"").front(), left + kWidestCharacter * 24);
}

// When the same episode in two engines parts: frame, points, falls, quartiles.

Lifetime together(const EpisodeRow& a, const EpisodeRow& b) {
  const std::optional<Lifetime> lifetime = time_together(a, b, 0.05);
  EXPECT_TRUE(lifetime.has_value());
  const std::optional<Lifetime> turned = time_together(b, a, 0.05);
  EXPECT_EQ(turned->time, lifetime->time);
  EXPECT_EQ(turned->ended, lifetime->ended);
  return lifetime.value_or(Lifetime{});
}

TEST(EngineParting, IsTheFirstFrameFurtherApartThanAsked) {
  const EpisodeRow still = traced("mujoco", 0, {0, 0, 0, 0});
  Lifetime lifetime = together(still, traced("ode", 0, {0, 50, 51, 0}));
  EXPECT_TRUE(lifetime.ended);
  EXPECT_DOUBLE_EQ(lifetime.time, 0.2);
  lifetime = together(still, traced("ode", 0, {0, 50, -50, 0}));
  EXPECT_FALSE(lifetime.ended);
  EXPECT_DOUBLE_EQ(lifetime.time, 0.3);
  EpisodeRow hand = still;
  hand.trace.mm[1] = {0, 0, 0, 30, 330, 930};  // 52 mm along the diagonal
  EXPECT_DOUBLE_EQ(together(still, hand).time, 0.1);
}

TEST(EngineParting, PointsAreFoundByName) {
  const EpisodeRow a = traced("mujoco", 0, {0, 0, 0});
  EpisodeRow b = a;
  b.trace.points = {"left_hand", "head", "root"};
  for (std::vector<int>& frame : b.trace.mm) frame = {0, 300, 900, 7, 7, 7, 0, 0, 0};
  EXPECT_FALSE(together(a, b).ended);
  b.trace.mm[2][6] = 100;
  EXPECT_DOUBLE_EQ(together(a, b).time, 0.2);
}

TEST(EngineParting, AFallInOneEngineAloneIsAParting) {
  const EpisodeRow whole = traced("mujoco", 0, {0, 0, 0, 0, 0, 0});
  for (const Outcome outcome : {Outcome::kFell, Outcome::kDiverged}) {
    EpisodeRow fallen = traced("ode", 0, {0, 0, 0});
    fallen.outcome = outcome;
    EXPECT_TRUE(together(whole, fallen).ended);
    EXPECT_DOUBLE_EQ(together(whole, fallen).time, 0.2);
    EpisodeRow also_fallen = whole;
    also_fallen.outcome = Outcome::kFell;
    EXPECT_FALSE(together(also_fallen, fallen).ended);
    EpisodeRow cut_short = traced("mujoco", 0, {0, 0});  // timed out before the other fell
    cut_short.outcome = Outcome::kTimedOut;
    EXPECT_FALSE(together(cut_short, fallen).ended);
    EXPECT_DOUBLE_EQ(together(cut_short, fallen).time, 0.1);
  }
}

TEST(EngineParting, TracesThatCannotBeComparedAreNone) {
  const EpisodeRow a = traced("mujoco", 0, {0, 0});
  EpisodeRow b = a;
  b.trace.rate_hz = 20.0;
  EXPECT_FALSE(time_together(a, b, 0.05).has_value());
  b = a;
  b.trace.mm.clear();
  EXPECT_FALSE(time_together(a, b, 0.05).has_value());
  b = a;
  b.trace.points = {"head", "feet"};
  EXPECT_FALSE(time_together(a, b, 0.05).has_value());
}

TEST(EngineParting, QuartilesAreThoseOfKaplanAndMeier) {
  const std::vector<int> still(10, 0);
  const auto moved_at = [&](std::size_t frame) {
    std::vector<int> x = still;
    x[frame] = 80;
    return x;
  };
  // Parted after 0.3, 0.3 and 0.7 s, one seen for 0.4 s only: 1/2 left after 0.3 s, none after 0.7 s.
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 5; ++i) rows.push_back(traced("mujoco", i, still));
  rows.push_back(traced("ode", 0, moved_at(3)));
  rows.push_back(traced("ode", 1, moved_at(7)));
  rows.push_back(traced("ode", 2, std::vector<int>(5, 0)));
  rows.push_back(traced("ode", 3, moved_at(3)));
  rows.push_back(traced("ode", 4, {}));
  const Estimates parting = cross_engine(rows, {}, {.intervals = {.resamples = 200}}).parting;
  const auto of = [&](const char* name) { return *find_estimate(parting, {.name = name}); };
  EXPECT_EQ(of("parted").n, 4);
  EXPECT_EQ(of("parted").value, 3.0);
  EXPECT_EQ(of("without_trace").value, 1.0);
  EXPECT_DOUBLE_EQ(of("parting_lower_quartile").value, 0.3);
  EXPECT_DOUBLE_EQ(of("parting_median").value, 0.3);
  EXPECT_DOUBLE_EQ(of("parting_upper_quartile").value, 0.7);
}

nlohmann::json certificate() {
  return nlohmann::json::parse(R"({"schema": "duet.certificate/1", "effort": "full",
    "created_at": "2026-01-02T03:04:05Z", "digest": "0123456789abcdef", "engines": [
      {"name": "mujoco", "version": "2.2.2", "profile": "parity", "passed": 20, "failed": 0, "deviations": 1},
      {"name": "ode", "version": "0.16.2", "profile": "parity", "passed": ["a", "b"], "failed": [], "deviations": {}}
    ]})");
}

std::string certificate_text(const nlohmann::json& certificate, const std::vector<RunEngine>& engines = {}) {
  return markdown_of(certificate_table(certificate, engines));
}

TEST(Certificate, IsATableOfEngines) {
  const std::string text = certificate_text(certificate());
  EXPECT_SENTENCE(text);
}

TEST(Certificate, WithoutOneSaysHowToMakeOne) {
  EXPECT_EQ(certificate_text(nullptr),
            "### Parity certificate\n\nNo parity certificate is attached (duet validate makes one).\n");
}

TEST(Certificate, IsReadTolerantly) {
  EXPECT_THAT(certificate_text({{"schema", "duet.certificate/9"}, {"engines", {{{"name", "dart"}, {"x", 1}}, 3}}}),
              AllOf(HasSubstr("| dart   | -       | -       |             - |                   - |      - |"),
                    HasSubstr("Effort -, made -"), HasSubstr("Its schema is duet.certificate/9, expected")));
  EXPECT_SENTENCE(certificate_text({{"engines", "none"}}));
  EXPECT_SENTENCE(certificate_text("yes"));
  EXPECT_THAT(certificate_text({{"effort", "a\xff"}}), HasSubstr("digest"));
  EXPECT_THAT(certificate_text({{"effort", "<img src=x>\x1b[0m\n# no"}}),
              HasSubstr("Effort &lt;img src=x>\\x1b[0m # no, made"));
}

TEST(Certificate, NamesEnginesThatItDoesNotCoverAsTheyWereRun) {
  const std::string text = certificate_text(
      certificate(), {{"mujoco", "2.2.2", "parity"}, {"ode", "0.16.2", "fast"}, {"dart", "6.12", "parity"}});
  EXPECT_SENTENCE(text);
  EXPECT_THAT(certificate_text(certificate(), {{"ode", "", ""}}), Not(HasSubstr("These results")));
}

}  // namespace
}  // namespace duet
