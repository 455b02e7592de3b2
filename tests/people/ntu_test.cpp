
#include <cmath>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/people/formats/people_formats.h"
#include "tests/motion/people_files.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::ScratchFolder;
using test::thrown_message;

constexpr int kFrames = 40;

RawPeople two_people() {
  return test::standin_people(test::standin_clip(kFrames, 30.0), joint_layout("ntu-25"), test::y_up());
}

std::string body(const RawPeople& people, std::size_t who, int t, const std::string& id,
                 const std::string& state = "2") {
  std::string text = id + " 0 1 1 1 1 0 0.02 -0.1 2\n25\n";
  for (int j = 0; j < 25; ++j) {
    const Eigen::Vector3d p = people.joints[who].at(t, j);
    text += fmt::format("{:.7f} {:.7f} {:.7f} 279.9 186.2 990.5 498.1 -0.2 -0.03 0.9 -0.1 {}\n", p.x(), p.y(), p.z(),
                        state);
  }
  return text;
}

// Person B comes in frame 3; a chair is taken for a third in frames 5 to 9.
std::string skeleton_text(const RawPeople& people) {
  std::string text = fmt::format("{}\n", kFrames);
  for (int t = 0; t < kFrames; ++t) {
    const bool third = t >= 5 && t < 10;
    text += fmt::format("{}\n", 1 + (t >= 3 ? 1 : 0) + (third ? 1 : 0));
    text += body(people, 0, t, "72057594037931101", t == 20 ? "0" : "2");
    if (third) text += body(people, 0, 0, "72057594037931200");
    if (t >= 3) text += body(people, 1, t, "72057594037931368");
  }
  return text;
}

SourceClip read(const std::string& folder) {
  const std::vector<std::string> paths = {folder};
  const PeopleFormat& format = find_people_format(paths);
  EXPECT_EQ(format.name, "ntu");
  return read_source_clip(format, format.find(paths, {}).at(0), {.output_rate_hz = 30.0});
}

TEST(Ntu, TheTwoBodiesThatAreSeenLongestAreRead) {
  const ScratchFolder folder;
  const RawPeople people = two_people();
  write_file(folder / "S001C003P008R002A058.skeleton", skeleton_text(people));
  const SourceClip found = read(folder / "");
  EXPECT_EQ(found.clip.id, "S001C003P008R002A058");
  EXPECT_EQ(found.clip.task, Task::kHandshake);
  EXPECT_EQ(found.clip.source.at("label"), "shaking hands");
  EXPECT_EQ(found.clip.frames(), kFrames - 3);
  EXPECT_SENTENCE(found.evidence);
  const InteractionClip known = test::standin_clip(kFrames, 30.0);
  for (const SmplJoint joint : {kLeftHip, kRightKnee, kLeftShoulder, kRightElbow}) {
    const auto apart = [&](const InteractionClip& clip, int t) {
      return (clip.a.joints.at(t, joint) - clip.b.joints.at(t, kLeftHip)).norm();
    };
    for (int t = 0; t < found.clip.frames(); t += 5) EXPECT_NEAR(apart(found.clip, t), apart(known, t + 3), 1e-5) << t;
  }
}

TEST(Ntu, BadFilesAreRefusedByLine) {
  const ScratchFolder folder;
  const std::string good = skeleton_text(two_people());
  const auto refusal = [&](const std::string& text) {
    write_file(folder / "x.skeleton", text);
    const std::vector<std::string> paths = {folder / "x.skeleton"};
    const PeopleFormat& format = find_people_format(paths);
    PeopleOptions options;
    options.task = Task::kHug;
    return thrown_message<InputError>([&] { (void)read_source_clip(format, format.find(paths, {}).at(0), options); });
  };
  for (const char* text : {"many\n", "1\n", "1\n1\n7 0 1\n", "1\n1\n7 0 1 1 1 1 0 0 0 2\n20\n"})
    EXPECT_SENTENCE(refusal(text));
  EXPECT_SENTENCE(refusal(good.substr(0, good.size() / 2)));
  EXPECT_SENTENCE(refusal("1\n1\n" + body(two_people(), 0, 0, "7")));
  const std::string twice = body(two_people(), 0, 0, "7");
  EXPECT_SENTENCE(refusal("1\n2\n" + twice + twice));
  const std::string other = body(two_people(), 1, 0, "8");
  EXPECT_SENTENCE(refusal("2\n1\n" + twice + "1\n" + other));
}

}  // namespace
}  // namespace duet
