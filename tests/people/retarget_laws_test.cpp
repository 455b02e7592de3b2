// The laws of retargeting over a recording of people (tests/retarget/retarget_laws_test.cpp has those over synthesis).
#include "tests/retarget/retarget_laws.h"

#include "duet/people/formats/people_formats.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::expect_laws;

TEST(RetargetLaws, HoldOverARecording) {
  const std::string file = test::shared_file("data/k3hi/k3hi-shaking-1.npz");
  if (file.empty()) GTEST_SKIP() << "not run: data/k3hi absent";
  const std::vector<std::string> paths = {file};
  PeopleOptions options;
  options.task = Task::kHandshake;
  const PeopleFormat& format = find_people_format(paths);
  InteractionClip clip = read_source_clip(format, format.find(paths, options).front(), options).clip;
  for (HumanMotion* motion : {&clip.a, &clip.b}) *motion = resample(*motion, 50.0);
  clip.phases = {};
  clip.contacts.clear();
  expect_laws(clip, test::g1());
}

}  // namespace
}  // namespace duet
