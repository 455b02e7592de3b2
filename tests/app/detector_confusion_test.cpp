// Sensitivity and specificity over recordings with labels: what counts where, and what `duet bench detectors` says.
#include "duet/datasets/labelled/detector_confusion.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <fstream>

#include "duet/core/require.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/app/program.h"

namespace duet {
namespace {

using test::duet_program;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

LabelledVerdicts judged(const std::string& clip, const std::string& label,
                        const std::vector<std::pair<Task, std::array<bool, 2>>>& by_act) {
  LabelledVerdicts verdicts{.clip = clip, .label = label};
  verdicts.accepted.assign(kThresholdSets.size(), std::vector<std::array<bool, 2>>(all_tasks().size()));
  for (const auto& [task, performers] : by_act)
    verdicts.accepted[static_cast<std::size_t>(ThresholdSet::kAct)][task.index()] = performers;
  return verdicts;
}

std::vector<LabelledVerdicts> four_clips() {
  return {judged("first", "hug", {{Task::kHug, {true, false}}}),
          judged("second", "pushing", {{Task::kHug, {false, true}}, {Task::kWave, {true, true}}}),
          judged("third", "handshake", {{Task::kHandshake, {true, true}}}),
          {.clip = "fourth", .label = "", .message = "no people"}};
}

// Accepted of the act, all of it, refused of others, all of them.
using Counts = std::array<long, 4>;
Counts counts(const DetectorRates& rates) { return {rates.hits, rates.acts, rates.refused, rates.others}; }

TEST(DetectorConfusion, CountsEachOfTheTwoOnce) {
  const std::vector<DetectorRates> rates = detector_rates(four_clips(), {ThresholdSet::kAct});
  ASSERT_EQ(rates.size(), all_tasks().size());
  EXPECT_EQ(rates[0].task, Task::kHug);
  EXPECT_EQ(counts(rates[0]), (Counts{1L, 2L, 3L, 4L}));
  const DetectorRates& handshake = rates[Task(Task::kHandshake).index()];
  EXPECT_EQ(counts(handshake), (Counts{2L, 2L, 4L, 4L}));
  const DetectorRates& wave = rates[Task(Task::kWave).index()];
  EXPECT_EQ(counts(wave), (Counts{0L, 0L, 4L, 6L}));
}

TEST(DetectorConfusion, TablesSayWhatWasCounted) {
  const TextTable rates = rates_table(detector_rates(four_clips(), {ThresholdSet::kAct}));
  EXPECT_THAT(rates.rows[0], ElementsAre("act", "hug", "1/2", "50.0", "[9.5, 90.5]", "3/4", "75.0", "[30.1, 95.4]"));
  EXPECT_EQ(rates.rows[Task(Task::kWave).index()][2], "-");
  const TextTable confusion = confusion_table(four_clips(), ThresholdSet::kAct);
  EXPECT_EQ(confusion.header[0], "act: label");
  ASSERT_EQ(confusion.rows.size(), 3u);
  EXPECT_EQ(confusion.rows[0][0], "hug");  // tasks before other labels
  EXPECT_EQ(confusion.rows[2][0], "pushing");
  EXPECT_EQ(confusion.rows[2][1], "2");
  EXPECT_EQ(confusion.rows[2][2 + Task(Task::kHug).index()], "1");
  EXPECT_EQ(confusion.rows[2][2 + Task(Task::kWave).index()], "2");
  const TextTable wrong = wrong_table(four_clips(), {ThresholdSet::kAct});
  ASSERT_EQ(wrong.rows.size(), 5u);
  EXPECT_THAT(wrong.rows[0], ElementsAre("act", "first", "hug", "B", "hug", "missed"));
  EXPECT_THAT(wrong.rows[1], ElementsAre("act", "second", "pushing", "B", "hug", "accepted"));
  EXPECT_THAT(wrong.rows[4], ElementsAre("-", "fourth", "-", "-", "-", "not read: no people"));
}

TEST(DetectorConfusion, JsonHasTheSameCounts) {
  const nlohmann::json json = confusion_json(four_clips(), {ThresholdSet::kAct}, true);
  EXPECT_EQ(json["clips"], 4);
  EXPECT_EQ(json["unread"][0]["clip"], "fourth");
  const nlohmann::json& hug = json["sets"]["act"]["detectors"]["hug"];
  EXPECT_EQ(hug["sensitivity"]["hits"], 1);
  EXPECT_EQ(hug["specificity"]["share"], 0.75);
  EXPECT_TRUE(json["sets"]["act"]["detectors"]["wave"]["sensitivity"].is_null());
  EXPECT_EQ(json["sets"]["act"]["confusion"]["pushing"]["accepted"]["wave"], 2);
  EXPECT_EQ(json["wrong"].size(), 4u);
}

class ClipFolder {
 public:
  ClipFolder() {
    for (const Task task : {Task::kHug, Task::kWave}) {
      const InteractionClip clip = synthesize(task, {.seed = 5});
      save_clip(clip, folder_ / (std::string(to_string(task)) + ".npz"));
    }
  }
  [[nodiscard]] std::string path() const { return folder_ / ""; }

 private:
  test::ScratchFolder folder_;
};

TEST(DetectorConfusion, ClipsOfDuetSayWhatTheyAre) {
  const ClipFolder folder;
  const std::vector<LabelledVerdicts> verdicts = judge_labelled({.paths = {folder.path()}});
  ASSERT_EQ(verdicts.size(), 2u);
  EXPECT_EQ(verdicts[0].clip, "hug");
  EXPECT_EQ(verdicts[0].label, "hug");
  for (const DetectorRates& rates : detector_rates(verdicts, {ThresholdSet::kAct})) {
    EXPECT_EQ(rates.hits, rates.acts) << to_string(rates.task);
    EXPECT_EQ(rates.refused, rates.others) << to_string(rates.task);
  }
}

TEST(DetectorConfusion, AFileOfLabelsGoesFirst) {
  const ClipFolder folder;
  const std::vector<LabelledVerdicts> verdicts =
      judge_labelled({.paths = {folder.path()}, .labels = {{"hug", "Shake hands"}, {"wave", ""}}});
  ASSERT_EQ(verdicts.size(), 1u);
  EXPECT_EQ(verdicts[0].label, "handshake");
  EXPECT_EQ(judge_labelled({.paths = {folder.path()}, .labels = {{"hug", "lifting"}}})[0].label, "lifting");
  EXPECT_THAT(test::thrown_message<InputError>([&] {
                (void)judge_labelled({.paths = {folder.path()}, .labels = {{"hugs", "hug"}}});
              }),
              HasSubstr("did you mean 'hug'"));
}

TEST(DetectorConfusion, AClipThatCannotBeReadIsNamedAndCountsNowhere) {
  const ClipFolder folder;
  std::ofstream(folder.path() + "broken.npz") << "no archive";
  const std::vector<LabelledVerdicts> verdicts = judge_labelled({.paths = {folder.path() + "hug.npz", folder.path()}});
  ASSERT_EQ(verdicts.size(), 4u);
  EXPECT_THAT(verdicts[1].message, HasSubstr("broken.npz"));
  EXPECT_EQ(detector_rates(verdicts, {ThresholdSet::kAct})[0].acts, 4);
}

TEST(DetectorConfusion, SameVerdictsWhateverTheNumberOfThreads) {
  const ClipFolder folder;
  const auto text = [&](int threads) {
    return confusion_json(judge_labelled({.paths = {folder.path()}, .threads = threads}),
                          {kThresholdSets.begin(), kThresholdSets.end()}, true)
        .dump();
  };
  EXPECT_EQ(text(1), text(3));
}

TEST(DetectorConfusion, TheProgramPrintsTablesOfClipsWithLabels) {
  const ClipFolder folder;
  const test::ScratchFolder other;
  std::ofstream(other / "labels.csv") << "clip,label\nwave,pointing\n";
  const std::string command =
      fmt::format("bench detectors --clips {} --labels {} ", folder.path(), other / "labels.csv");
  const test::Answer answer = duet_program(command + "--list --thresholds act");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("| act | hug       |                 2/2 |         100.0 |"));
  EXPECT_THAT(answer.out, HasSubstr("| act | wave | pointing | A         | wave     | accepted |"));
  const nlohmann::json json = nlohmann::json::parse(duet_program(command + "--json").out);
  EXPECT_EQ(json["sets"].size(), 3u);
  EXPECT_THAT(duet_program(command + "--csv").out, HasSubstr("set,detector,accepted of the act"));
  EXPECT_THAT(duet_program("bench detectors --clips 2 --list").err, HasSubstr("are for recordings"));
  EXPECT_THAT(duet_program("bench detectors --clips 2 --strict --thresholds act").err, HasSubstr("exclude each other"));
  EXPECT_THAT(duet_program("bench detectors --clips 0").err, HasSubstr("expected a whole number from 1"));
  EXPECT_EQ(duet_program("bench detectors --clips 2 --strict").out,
            duet_program("bench detectors --clips 2 --thresholds strict").out);
}

// Checks what docs/detectors.md says of recorded people.
TEST(DetectorConfusion, TheActSetTellsHugsAndHandshakesOfRecordedPeople) {
  const std::string folder = test::shared_file("data/sbu");
  if (folder.empty()) GTEST_SKIP() << "not run: shared data/sbu absent";
  const std::vector<DetectorRates> rates =
      detector_rates(judge_labelled({.paths = {folder}, .threads = 2}), {ThresholdSet::kAct});
  const DetectorRates& hug = rates[Task(Task::kHug).index()];
  EXPECT_EQ(counts(hug), (Counts{41L, 42L, 522L, 522L}));
  const DetectorRates& handshake = rates[Task(Task::kHandshake).index()];
  EXPECT_EQ(counts(handshake), (Counts{28L, 36L, 528L, 528L}));
}

}  // namespace
}  // namespace duet
