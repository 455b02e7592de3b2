// Which task a recording without a label is.
#include "duet/datasets/people_clip.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "duet/core/file.h"
#include "duet/datasets/curation.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/datasets/recordings.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

// The strict handshake, which is asked first, takes every high-five; the rule of the act does not.
TEST(PeopleClip, ARecordingWithoutALabelIsRecognisedByItsAct) {
  const test::ScratchFolder folder;
  for (const Task task : {Task::kHug, Task::kHandshake, Task::kHighFive, Task::kWave}) {
    const std::vector<std::string> paths = {folder / (std::string(to_string(task)) + ".npz")};
    test::write_recording(paths.front(), synthesize(task, {.seed = 3}), "");
    const PeopleFormat& format = find_people_format(paths);
    const PeopleClip found = read_people_clip(format, format.find(paths, {}).at(0), {});
    ASSERT_TRUE(found.source.has_value()) << to_string(task);
    EXPECT_EQ(found.source->clip.task, task) << to_string(task);
    EXPECT_NE(found.source->evidence.back().find("act thresholds; no label"), std::string::npos)
        << found.source->evidence.back();
  }
}

class SourceFactsTest : public ::testing::Test {
 protected:
  // A forearm of `share` times its length in 45 of 100 frames.
  void write(const std::string& name, double share, const std::string& label) {
    InteractionClip clip = synthesize(Task::kHandshake, {.seed = 11});
    for (int t = 0; t < clip.frames(); ++t) {
      const Eigen::Vector3d forearm = clip.b.joints.at(t, kRightWrist) - clip.b.joints.at(t, kRightElbow);
      for (const int j : {kRightWrist, kRightHand})
        clip.b.joints.frame(t).col(j) += (share - 1.0) * (t % 100 < 45) * forearm;
    }
    test::write_recording(folder_ / name, clip, label);
  }
  [[nodiscard]] std::vector<ClipPlace> places() const { return format().find(paths_, {}); }
  [[nodiscard]] const PeopleFormat& format() const { return find_people_format(paths_); }

  test::ScratchFolder folder_;
  const std::vector<std::string> paths_ = {folder_ / ""};
};

TEST_F(SourceFactsTest, TheUsualBoneIsTheMedianOfFiveOrMore) {
  for (int k = 0; k < 4; ++k) write(fmt::format("{}.npz", k), 1.3, "kicking");
  EXPECT_EQ(usual_bone_change(format(), places(), {}, 2), 0.0) << "four are too few";
  write("9.npz", 1.0, "kicking");
  const double usual = usual_bone_change(format(), places(), {}, 2);
  EXPECT_NEAR(usual, 0.3, 0.011);
  EXPECT_EQ(usual, usual_bone_change(format(), places(), {}, 1));
}

TEST_F(SourceFactsTest, LabelsAreCountedAndBrokenFilesLeftOut) {
  write("a.npz", 1.0, "kicking");
  write("b.npz", 1.0, "kicking");
  write("c.npz", 1.0, "hugging");
  write("d.npz", 1.0, "");
  write_file(folder_ / "e.npz", "PK");
  EXPECT_THAT(count_labels(format(), places(), {}, 2),
              ElementsAre(Pair("", 1), Pair("hugging", 1), Pair("kicking", 2)));
  EXPECT_TRUE(SourceFacts{.labels = count_labels(format(), places(), {}, 1)}.is_mixed());
}

}  // namespace
}  // namespace duet
