// People in the robot's place: who counts, and what `duet score --people` prints of them.
#include "duet/datasets/labelled/people_conditions.h"

#include <gmock/gmock.h>

#include "duet/motion/synthesis/synthesis.h"
#include "tests/app/program.h"

namespace duet {
namespace {

using test::duet_program;
using ::testing::HasSubstr;

// Two synthetic clips a task, and one whose second person stands as in the first frame.
LabelledClips clips_in(const std::string& folder) {
  for (const Task task : {Task::kWave, Task::kHandshake})
    for (const int i : {0, 1}) {
      const InteractionClip clip = synthesize(task, {.seed = 881, .index = i});
      save_clip(clip, folder + "/" + clip.id + ".npz");
    }
  InteractionClip alone = synthesize(Task::kWave, {.seed = 881, .index = 2});
  for (int t = 1; t < alone.b.joints.frames(); ++t) alone.b.joints.frame(t) = alone.b.joints.frame(0);
  save_clip(alone, folder + "/alone.npz");
  return {.paths = {folder}};
}

TEST(PeopleConditions, CountEachPersonWhoActs) {
  const test::ScratchFolder folder;
  const PeopleVerdicts verdicts = judge_people(clips_in(folder / "."));
  EXPECT_EQ(verdicts.still, 1);
  EXPECT_EQ(verdicts.people.size(), 9U);
  const nlohmann::json json = people_conditions_json(verdicts);
  const nlohmann::json& wave = json["tasks"]["wave"];
  EXPECT_EQ(wave["conditions"]["act"]["of"], 5);
  EXPECT_EQ(wave["others_refused"]["of"], 4);
  EXPECT_EQ(wave["others_refused"]["hits"], 4);
  EXPECT_TRUE(json["tasks"]["hug"]["all"].is_null());
  EXPECT_EQ(json["tasks"]["hug"]["others_refused"]["of"], 9);
}

TEST(PeopleConditions, AreATableOfScore) {
  const test::ScratchFolder folder;
  (void)clips_in(folder / ".");
  const test::Answer answer = duet_program("score -q --people --each " + (folder / "."));
  ASSERT_EQ(answer.code, 0) << answer.err;
  for (const char* words : {"| task", "act %", "reply %", "all of them %", "others refused %", "| clip"})
    EXPECT_THAT(answer.out, HasSubstr(words));
  EXPECT_THAT(duet_program("score -q --labels x.csv " + (folder / ".")).err, HasSubstr("--labels is for --people"));
}

}  // namespace
}  // namespace duet
