// The values that rows hold beside names: from the suite where they are made, and from the run's suite where they are
// from before there were tags.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>

#include "duet/core/file.h"
#include "duet/execution/missing_tags.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/work/run_work.h"
#include "duet/motion/interaction_clip.h"
#include "duet/report/studies/studies.h"
#include "tests/experiment/fixtures.h"
#include "tests/report/estimates.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

Suite suite_of(const std::string& rest) {
  return parse_suite(
      "schema: duet.suite/1\nname: t\nversion: 1.0.0\nengines: [mujoco]\ncontrollers: [pd]\nstart: clip\n"
      "retarget: {stage1-iterations: 1, stage2-iterations: 0}\n" +
          rest,
      "t.yaml");
}

// Rows as they are before their episodes run.
std::vector<EpisodeRow> rows_of(const Suite& suite) {
  Progress quiet(Progress::Style::kQuiet);
  Experiment experiment(suite);
  experiment.prepare(1, quiet);
  std::vector<EpisodeRow> rows;
  for (std::int64_t i = 0; i < experiment.size(); ++i) rows.push_back(experiment.row(i));
  return rows;
}

RunInfo info_of(const Suite& suite) {
  RunInfo info;
  info.suite = suite.name;
  info.suite_version = suite.version;
  info.suite_yaml = resolved_yaml(suite);
  return info;
}

void expect_the_same_from_the_suite(const Suite& suite) {
  const std::vector<EpisodeRow> rows = rows_of(suite);
  std::vector<EpisodeRow> old = rows;
  for (EpisodeRow& row : old) row.tags = {};
  ASSERT_TRUE(add_missing_tags(info_of(suite), old));
  for (std::size_t i = 0; i < rows.size(); ++i)
    EXPECT_EQ(old[i].tags.map(), rows[i].tags.map()) << rows[i].clip << " " << rows[i].perturbation;
}

TEST(EpisodeTags, ANameThatLiesIsTabledByItsValue) {
  const Suite suite = suite_of(
      "clips: {synth: {per_task: 1}}\ntasks: [wave]\npolicies: [replay]\nnull_arm: false\n"
      "perturbations: [clean, {name: push_60n, push: {force: 5}}, {name: push_9n, push: {force: 20}}]\n");
  std::vector<EpisodeRow> rows = rows_of(suite);
  ASSERT_EQ(rows.size(), 3U);
  for (EpisodeRow& row : rows) row.success = row.perturbation == "clean";
  const Analysis analysis = degradation_analysis(rows);
  EXPECT_EQ(test::estimate(analysis, {.of = "push", .name = "largest"}).value, 20.0);
  const Estimate size = test::estimate(analysis, {.perturbation = "push_60n", .of = "push", .name = "size"});
  EXPECT_EQ(size.value, 5.0);
  EXPECT_EQ(size.unit, "N");
}

TEST(EpisodeTags, AreThoseOfPerturbationClipAndPolicy) {
  const std::vector<EpisodeRow> rows =
      rows_of(suite_of("clips: {synth: {per_task: 1}}\ntasks: [wave]\nnull_arm: false\n"
                       "policies: [{name: dstar-seed7, use: replay, tags: {method: mine, seed: 101}}]\n"
                       "perturbations: [{name: level_9, tags: {level: 2}, vanish: {at: 1}}]\n"));
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_THAT(rows[0].tags.map(),
              ElementsAre(Pair("clip.people", "synthetic"), Pair("perturbation.kinds", "vanish"),
                          Pair("perturbation.level", "2"), Pair("policy.method", "mine"), Pair("policy.seed", "101")));
  EXPECT_EQ(row_from_json(to_json(rows[0])).tags, rows[0].tags);
}

TEST(EpisodeTags, OfACommandAreItsReferences) {
  const std::vector<EpisodeRow> rows = rows_of(parse_suite(
      "schema: duet.suite/1\nname: t\nversion: 1.0.0\nengines: [mujoco]\ncontrollers: [pd]\n"
      "reference: {name: stage_3_lies, tags: {stage: 1, stage_name: own}, velocity: [0, 0, 0], seconds: 1}\n",
      "t.yaml"));
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_THAT(rows[0].tags.map(), ElementsAre(Pair("clip.stage", "1"), Pair("clip.stage_name", "own")));
}

TEST(EpisodeTags, AreNoPartOfWhatASuiteRuns) {
  const std::string rest = "clips: {synth: {per_task: 1}}\ntasks: [wave]\n";
  const Suite plain = suite_of(rest + "policies: [replay]\nperturbations: [{name: a, push: {force: 5}}]\n");
  const Suite tagged = suite_of(
      rest +
      "policies: [{name: replay, tags: {seed: 1}}]\nperturbations: [{name: a, push: {force: 5}, tags: {level: 1}}]\n");
  EXPECT_EQ(suite_hash(plain), suite_hash(tagged));
  EXPECT_EQ(identity_of(plain).policies, identity_of(tagged).policies);
  EXPECT_THAT(resolved_yaml(tagged), HasSubstr("tags: {level: 1}"));
  EXPECT_EQ(resolved_yaml(parse_suite(resolved_yaml(tagged), "again.yaml")), resolved_yaml(tagged));
}

TEST(MissingTags, AreThoseThatTheSuiteGivesNow) {
  expect_the_same_from_the_suite(
      suite_of("clips: {synth: {per_task: 2, like: people, tracked: true}, pad: {before: 1, after: 1}, roles: both}\n"
               "tasks: [wave, handshake]\npolicies: [replay]\n"
               "perturbations: [clean, {name: a, jitter: {sigma: 0.01}, tags: {level: 1}}]\n"));
  expect_the_same_from_the_suite(
      suite_of("clips:\n  synth:\n    per_task: 1\n    variants: [{name: a-B, side: left, target_height: 0.9}, {name: "
               "b, side: right}]\n"
               "  roles: both\ntasks: [handshake]\npolicies: [{name: p, use: replay, tags: {method: m, seed: 3}}]\n"));
}

TEST(MissingTags, OfRecordingsBesideTheirTwins) {
  const test::ScratchFolder folder;
  InteractionClip clip = synthesize(Task::kWave, {.like = Likeness::kPeople});
  clip.id = "people-wave-s7-0000";  // as none of the suite's is called
  clip.source.clear();
  save_clip(clip, folder / "clip.npz");
  expect_the_same_from_the_suite(suite_of("clips: {files: [" + (folder / "clip.npz") +
                                          "], synth: {per_file: 1, seed: 5, like: people}, roles: both}\n"
                                          "tasks: [wave]\npolicies: [replay]\n"));
}

TEST(MissingTags, RowsThatHaveSomeKeepThem) {
  const Suite suite = suite_of("clips: {synth: {per_task: 1}}\ntasks: [wave]\npolicies: [replay]\nnull_arm: false\n");
  std::vector<EpisodeRow> rows = rows_of(suite);
  rows[0].tags = RowTags(Tags{{"policy.mine", "1"}});
  EXPECT_TRUE(add_missing_tags(info_of(suite), rows));
  EXPECT_THAT(rows[0].tags.map(), ElementsAre(Pair("policy.mine", "1")));
}

TEST(MissingTags, ASuiteThatCannotBeReadIsSaid) {
  duet::Run run;
  run.path = "there";
  run.info.suite_yaml = "schema: another/9\n";
  run.rows.emplace_back();
  add_missing_tags(run);
  EXPECT_TRUE(run.rows[0].tags.empty());
  ASSERT_EQ(run.warnings.size(), 1U);
  EXPECT_THAT(run.warnings[0], HasSubstr("'there': rows have no tags"));
}

TEST(MissingTags, ASuiteOfDescriptorsIsReadBesideThem) {
  const test::ScratchFolder folder;
  std::filesystem::copy_file(DUET_SOURCE_DIR "/controllers/descriptors/rl_gym.yaml", folder / "mine.yaml");
  const std::string yaml =
      "schema: duet.suite/1\nname: s\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
      "engines: [mujoco]\ncontrollers: [{name: mine, use: mine.yaml}]\npolicies: [replay]\nnull_arm: false\n"
      "perturbations: [{name: a, jitter: {sigma: 0.01}, tags: {level: 1}}]\n";
  duet::Run run;
  run.info.suite_yaml = yaml;
  run.info.suite_file = folder / "suite.yaml";
  EpisodeRow& row = run.rows.emplace_back();
  row.clip = synthesize(Task::kWave, {}).id;
  row.policy = "replay";
  row.perturbation = "a";
  add_missing_tags(run);
  EXPECT_TRUE(run.warnings.empty());
  EXPECT_EQ(row.tags.text("perturbation.level"), "1");
}

// No byte of them has changed, and every table that they had is there.
TEST(MissingTags, PublishedRowsGetThemFromTheirSuite) {
  const auto published = [](const std::string& name) {
    duet::Run run = load_run(std::string(DUET_SOURCE_DIR) + "/results/published/" + name);
    EXPECT_TRUE(std::ranges::all_of(run.rows, [](const EpisodeRow& row) { return row.tags.empty(); })) << name;
    add_missing_tags(run);
    EXPECT_TRUE(run.warnings.empty()) << name;
    return run.rows;
  };
  const auto count = [](const std::vector<EpisodeRow>& rows, std::string_view name, std::string_view value) {
    return std::ranges::count_if(rows, [&](const EpisodeRow& row) { return row.tags.text(name) == value; });
  };
  const std::vector<EpisodeRow> sealed = published("sealed");
  EXPECT_EQ(count(sealed, kPeopleTag, kSyntheticPeople), std::ssize(sealed));
  EXPECT_EQ(2 * count(sealed, kRecordingTag, ""), std::ssize(sealed));
}

// Rows that had theirs from the start, both roles of recordings and of their twins: taken away, the same come back.
TEST(MissingTags, AreThoseThatTheRunWouldHaveGiven) {
  duet::Run real = load_run(std::string(DUET_SOURCE_DIR) + "/results/published/real");
  std::vector<Tags> given;
  for (EpisodeRow& row : real.rows) {
    given.push_back(row.tags.map());
    row.tags = RowTags();
  }
  add_missing_tags(real);
  EXPECT_TRUE(real.warnings.empty());
  for (std::size_t i = 0; i < given.size(); ++i) ASSERT_EQ(real.rows[i].tags.map(), given[i]) << real.rows[i].key;
  EXPECT_EQ(std::ranges::count(given, "recorded", [](const Tags& tags) { return tags.at(std::string(kPeopleTag)); }),
            std::ssize(given) / 2);
}

}  // namespace
}  // namespace duet
