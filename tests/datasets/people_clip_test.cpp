// Which task a recording without a label is.
#include "duet/datasets/people_clip.h"

#include <gtest/gtest.h>

#include "duet/motion/synthesis/synthesis.h"
#include "tests/datasets/recordings.h"
#include "tests/support.h"

namespace duet {
namespace {

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

}  // namespace
}  // namespace duet
