// Every format of people: its stand-in is recognised, found and read back as the people that it was made of.
#include "duet/people/formats/people_formats.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/formats/inter/inter_x.h"
#include "duet/people/video_person.h"
#include "tests/motion/people_files.h"
#include "tests/people/body_files.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::people_standins;
using test::ScratchFolder;
using test::Standin;
using test::thrown_message;
using ::testing::Contains;

constexpr double kMillimetre = 1e-3;

std::vector<std::string> written(const Standin& standin, const ScratchFolder& folder) {
  for (const test::StandinFile& file : standin.files) write_file(folder / (standin.name + "/" + file.path), file.bytes);
  std::vector<std::string> paths;
  for (const std::string& path : standin.paths)
    paths.push_back(folder / (standin.name + (path.empty() ? "" : "/" + path)));
  return paths;
}

PeopleOptions options_of(const Standin& standin) {
  PeopleOptions options;
  for (std::size_t i = 0; i + 1 < standin.options.size(); i += 2) {
    if (standin.options[i] == "--task") options.task = parse_task(standin.options[i + 1]);
    if (standin.options[i] == "--rate") options.rate_hz = std::stod(standin.options[i + 1]);
    if (standin.options[i] == "--skeleton") options.skeleton = standin.options[i + 1];
  }
  return options;
}

SourceClip read_standin(const Standin& standin, const PeopleOptions& options) {
  const ScratchFolder folder;
  const std::vector<std::string> paths = written(standin, folder);
  const PeopleFormat& format = find_people_format(paths);
  const std::vector<ClipPlace> places = format.find(paths, options);
  EXPECT_EQ(places.size(), 1U) << standin.name;
  return read_source_clip(format, places.at(0), options);
}

// Heights of the file that are moved by what the feet say may be off by the spread of standing feet; all else is exact.
double height_between(const InteractionClip& found, const InteractionClip& expected) {
  return found.a.joints.at(0, kPelvis).z() - expected.a.joints.at(0, kPelvis).z();
}

TEST(PeopleFormat, EveryStandinComesBackAsTheClip) {
  for (const Standin& standin : people_standins()) {
    SourceClip found = read_standin(standin, options_of(standin));
    const InteractionClip clip = test::standin_clip(test::kStandinFrames, standin.rate_hz);
    const InteractionClip expected = test::expected_clip(clip, joint_layout(standin.layout));
    const double height = height_between(found.clip, expected);
    EXPECT_LT(std::abs(height), 0.01) << standin.name;
    for (HumanMotion* motion : {&found.clip.a, &found.clip.b})
      for (int t = 0; t < motion->frames(); ++t) motion->joints.frame(t).row(2).array() -= height;
    EXPECT_LT(test::worst_distance(found.clip, expected), kMillimetre) << standin.name;
    EXPECT_EQ(found.clip.source.at("format"), standin.format);
    EXPECT_THAT(found.evidence, Contains("format: " + standin.format));
  }
}

TEST(PeopleFormat, EveryFormatHasAStandin) {
  std::vector<std::string> tried = {"bvh"};  // bvh_import_test.cpp
  for (const Standin& standin : people_standins()) tried.push_back(standin.format);
  for (const char* name :
       {"inter-x-skeleton", "interhuman-processed", "core4d", "harmony4d", "hi4d", "chi3d", "bvh", "positions"})
    EXPECT_THAT(tried, Contains(name));
}

// No format takes another's files for its own.
TEST(PeopleFormat, EachStandinIsRecognisedByItsFormatOnly) {
  for (const Standin& standin : people_standins()) {
    const ScratchFolder folder;
    const std::vector<std::string> paths = written(standin, folder);
    for (const PeopleFormat& format : people_formats())
      EXPECT_EQ(format.recognises(paths), format.name == standin.format) << standin.name << " " << format.name;
  }
}

TEST(PeopleFormat, TheDataSetsOwnListsAreUsed) {
  const SourceClip inter_x = read_standin(test::inter_x_standin(), {});
  EXPECT_EQ(inter_x.clip.task, Task::kHandshake);  // A001
  EXPECT_EQ(inter_x.clip.reactor, Person::kA);     // P2 acts
  EXPECT_EQ(inter_x.clip.source.at("split"), "train");
  EXPECT_EQ(read_standin(test::hi4d_standin(), {}).clip.task, Task::kHug);
  EXPECT_EQ(read_standin(test::chi3d_standin(), {}).clip.task, Task::kHandshake);
  EXPECT_EQ(read_standin(test::kinect_standin(), {}).clip.task, Task::kHandshake);
  EXPECT_EQ(read_standin(test::core4d_standin(), options_of(test::core4d_standin())).clip.source.at("licence"),
            "CC BY 4.0");
}

TEST(PeopleFormat, Core4dsObjectMovesWithTheWrist) {
  const SourceClip found = read_standin(test::core4d_standin(), options_of(test::core4d_standin()));
  ASSERT_EQ(static_cast<int>(found.clip.object.poses.size()), found.clip.frames());
  EXPECT_LT((found.clip.object.poses[3].p - found.clip.a.joints.at(3, kRightWrist)).norm(), kMillimetre);
}

TEST(PeopleFormat, LabelsOfOthersAreTasks) {
  EXPECT_EQ(task_of_label("shaking_hands"), Task::kHandshake);
  EXPECT_EQ(task_of_label("01_hugging"), Task::kHug);
  EXPECT_EQ(task_of_label("High-five"), Task::kHighFive);
  EXPECT_EQ(task_of_label("Fly kiss"), Task::kFlyKiss);
  EXPECT_EQ(task_of_label("Handshake 3"), Task::kHandshake);
  EXPECT_EQ(task_of_label("kicking"), std::nullopt);
  EXPECT_EQ(task_of_label(""), std::nullopt);
}

// "wrist_x", "wrist.x", "wristX".
TEST(PeopleFormat, AnAxisMayBeSetOffByACapitalLetterOrAPoint) {
  const Standin usual = test::csv_pair_standin();
  const SourceClip expected = read_standin(usual, options_of(usual));
  for (const auto& [x, y, z] : {std::tuple{"X", "Y", "Z"}, std::tuple{".x", ".y", ".z"}}) {
    Standin other = usual;
    for (test::StandinFile& file : other.files) {
      std::string header = file.bytes.substr(0, file.bytes.find('\n'));
      const std::string rest = file.bytes.substr(header.size());
      for (const auto& [from, to] : {std::pair{"_x,", x}, std::pair{"_y,", y}, std::pair{"_z,", z}})
        for (std::size_t at = 0; (at = header.find(from, at)) != std::string::npos;)
          header.replace(at, 3, std::string(to) + ",");
      file.bytes = header + rest;
    }
    EXPECT_TRUE(read_standin(other, options_of(other)).clip.a.joints == expected.clip.a.joints) << x;
  }
}

TEST(PeopleFormat, OnlyNamesOfInterXTellItsActions) {
  EXPECT_EQ(inter_x_action("G001T000A001R010"), "Handshake");
  EXPECT_EQ(inter_x_action("G001T000A001R01"), std::nullopt);
  EXPECT_EQ(inter_x_action("X001T000A001R010"), std::nullopt);
  EXPECT_EQ(inter_x_action("G001T000B001R010"), std::nullopt);
  EXPECT_EQ(inter_x_action("G001T00A0001R010"), std::nullopt);
  EXPECT_EQ(inter_x_action("G001T000A0x1R010"), std::nullopt);
  EXPECT_EQ(inter_x_action("G001T000A999R010"), std::nullopt);
}

TEST(PeopleFormat, TwoFilesOfInterXAreNamedAfterTheirFolderOrThemselves) {
  for (const PeopleFormat& format : people_formats()) {
    if (format.name != "inter-x") continue;
    const std::vector<std::string> bare = {"P1.npz", "other.npz"}, below = {"G001/P1.npz", "G001/P2.npz"};
    EXPECT_EQ(format.find(bare, {}).at(0).id, "P1-other");
    EXPECT_EQ(format.find(below, {}).at(0).id, "G001");
    return;
  }
  FAIL() << "no format inter-x";
}

TEST(PeopleFormat, ManyClipsOfAFolderAreFound) {
  const ScratchFolder folder;
  for (const char* name : {"x.npz", "y.npz"}) write_file(folder / name, test::kinect_standin().files[0].bytes);
  const Standin pair = test::csv_pair_standin();
  write_file(folder / "dance_a.csv", pair.files[0].bytes);
  write_file(folder / "dance_b.csv", pair.files[1].bytes);
  const std::vector<std::string> paths = {folder / ""};
  const PeopleFormat& format = find_people_format(paths);
  const auto ids = [&] {
    std::vector<std::string> found;
    for (const ClipPlace& place : format.find(paths, {})) found.push_back(place.id);
    return found;
  };
  EXPECT_THAT(ids(), ::testing::ElementsAre("x", "y", "dance"));
  // One who is alone, and files that are broken, are clips that their reader refuses: the others go on.
  std::filesystem::remove(folder / "dance_b.csv");
  write_file(folder / "y.npz", "PK");
  write_file(folder / "z.npy", "\x93NUM");
  EXPECT_THAT(ids(), ::testing::ElementsAre("x", "y", "z", "dance_a"));
  for (const ClipPlace& place : format.find(paths, {})) {
    if (place.id == "x") continue;
    EXPECT_THROW((void)format.read(place, {}), InputError) << place.id;
  }
}

TEST(PeopleFormat, WhatIsOfNoFormatIsRefusedWithWhatItIs) {
  const ScratchFolder folder;
  write_file(folder / "x.txt", "hello");
  const std::vector<std::string> paths = {folder / "x.txt"}, missing = {folder / "none"};
  const std::string message = thrown_message<InputError>([&] { (void)find_people_format(paths); });
  EXPECT_SENTENCE(message);
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)find_people_format(missing); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)find_people_format(paths, "inter-y"); }));
  for (const PeopleFormat& format : people_formats())
    EXPECT_NE(thrown_message<InputError>([&] {
                for (const ClipPlace& place : format.find(paths, {})) (void)format.read(place, {});
              }),
              "(nothing was thrown)")
        << format.name;
}

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

// One person of an estimator's file, as the camera has them.

// In single precision, and through a rotation matrix.
constexpr double kSingle = 2e-6;

std::string write(const ScratchFolder& folder, const std::string& name, const std::string& bytes) {
  write_file(folder / name, bytes);
  return folder / name;
}

TEST(VideoPerson, OfPhalpIsTheOneWhoIsSeenForLongest) {
  const ScratchFolder folder;
  const test::BodyParameters brief = test::body_parameters(4, 0.3, 23, {0.0, 0.0, 1.0});
  const test::BodyParameters longer = test::body_parameters(6, 1.2, 23, {0.5, 0.1, 40.0});
  const std::string path = write(folder, "video.pkl", test::phalp_pkl({{7, 0, brief}, {3, 2, longer}}, 9));
  ASSERT_TRUE(is_video_person(path));
  const VideoPerson person = read_video_person(path, {.depth_scale = 0.05});
  EXPECT_EQ(person.format, "4d-humans");
  EXPECT_EQ(person.rate_hz, 30.0);
  ASSERT_EQ(person.joints.frames(), 9);
  EXPECT_EQ(person.seen, (std::vector<bool>{false, false, true, true, true, true, true, true, false}));
  const test::PosedBody expected = test::posed(longer, rest_joints(average_body(), longer.betas));
  for (int t = 0; t < 6; ++t) {
    const Eigen::Vector3d nearer(0.0, 0.0, (0.05 - 1.0) * longer.translation[static_cast<std::size_t>(3 * t + 2)]);
    for (int j = 0; j < kSmplJoints; ++j)
      EXPECT_LE((person.joints.at(t + 2, j) - (expected.joints[static_cast<std::size_t>(t)].col(j) + nearer)).norm(),
                10 * kSingle)
          << t << " " << j;
  }
}

TEST(VideoPerson, OfTwoWhoAreSeenAsLongIsTheNearer) {
  const ScratchFolder folder;
  const test::BodyParameters far = test::body_parameters(3, 0.3, 23, {0.0, 0.0, 5.0});
  const test::BodyParameters near = test::body_parameters(3, 1.2, 23, {0.0, 0.0, 2.0});
  const VideoPerson person =
      read_video_person(write(folder, "v.pkl", test::phalp_pkl({{1, 0, far}, {2, 0, near}}, 3)), {.rate_hz = 25.0});
  EXPECT_NEAR(person.joints.at(0, kPelvis).z(), 2.0, 0.06);
  EXPECT_EQ(person.rate_hz, 25.0);
}

TEST(VideoPerson, OfGvhmrIsInTheCamerasFrame) {
  const ScratchFolder folder;
  const test::BodyParameters body = test::body_parameters(4, 0.3, 21, {0.2, 0.1, 2.5});
  const std::string path = write(folder, "hmr4d_results.pt", test::gvhmr_pt(body, "smpl_params_incam"));
  const VideoPerson person = read_video_person(path);
  EXPECT_EQ(person.format, "gvhmr");
  ASSERT_EQ(person.joints.frames(), 4);
  for (int t = 0; t < 4; ++t)
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(person.joints.at(t, kPelvis)[i], body.translation[static_cast<std::size_t>(3 * t + i)], kSingle);
}

TEST(VideoPerson, NamesWhatIsWrong) {
  const ScratchFolder folder;
  const auto refusal = [&](const std::string& name, const std::string& bytes) {
    return test::thrown_message<InputError>([&] { (void)read_video_person(write(folder, name, bytes)); });
  };
  const test::BodyParameters body = test::body_parameters(3, 0.3);
  EXPECT_SENTENCE(refusal("world.pt", test::gvhmr_pt(body)));
  EXPECT_SENTENCE(test::thrown_message<InputError>(
      [&] { (void)read_phalp_person(write(folder, "nobody.pkl", test::phalp_pkl({}, 2)), {}); }));
  EXPECT_SENTENCE(refusal("text.txt", "text"));
  EXPECT_FALSE(is_video_person(folder / "text.txt"));
}

}  // namespace
}  // namespace duet
