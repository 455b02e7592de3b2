// Peculiarities of each of the formats of body models (tests/people/body_formats_test.cpp: what they share).
#include <gmock/gmock.h>

#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/people/source_clip.h"
#include "duet/people/bodies/body_model.h"
#include "duet/people/formats/inter/inter_x.h"
#include "duet/people/people_format.h"
#include "tests/people/body_files.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::BodyParameters;
using test::ScratchFolder;
using test::thrown_message;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kSameJoint = 1e-6;  // [m]

using Files = std::vector<std::string>;

// ---- Inter-X ------------------------------------------------------------

TEST(InterX, AFolderGivesEachClipWithItsActionAndReactor) {
  const ScratchFolder folder;
  const BodyParameters body = test::body_parameters(3, 1.0);
  for (const char* clip : {"G001T000A018R005", "G001T000A001R000", "G002T001A016R003"})
    for (const char* person : {"P1.npz", "P2.npz"})
      test::inter_x_npz(body).save(folder / ("motions/" + std::string(clip) + "/" + person));
  write_file(folder / "annots/interaction_order.pkl", test::PickleWriter()
                                                          .raw("}(")
                                                          .text("G001T000A001R000")
                                                          .integer(1)
                                                          .text("G002T001A016R003")
                                                          .integer(0)
                                                          .raw("u.")
                                                          .str());
  const Files paths = {folder / ""};
  ASSERT_TRUE(inter_x_format().recognises(paths));
  const std::vector<ClipPlace> clips = inter_x_format().find(paths, {});
  ASSERT_EQ(clips.size(), 3U);
  EXPECT_EQ(clips[0].id, "G001T000A001R000");
  const RawPeople handshake = inter_x_format().read(clips[0], {});
  EXPECT_EQ(handshake.task, Task::kHandshake);
  EXPECT_EQ(handshake.reactor, Person::kA);
  EXPECT_SENTENCE(handshake.evidence);
  const RawPeople whisper = inter_x_format().read(clips[1], {});
  EXPECT_FALSE(whisper.task.has_value());
  EXPECT_FALSE(whisper.reactor.has_value());
  EXPECT_SENTENCE(whisper.evidence);
  EXPECT_EQ(inter_x_format().read(clips[2], {}).reactor, Person::kB);
  EXPECT_EQ(whisper.source.at("label"), "Whisper in ear");
}

TEST(InterX, AnOrderThatIsNoneIsRefused) {
  const ScratchFolder folder;
  for (const char* person : {"P1.npz", "P2.npz"})
    test::inter_x_npz(test::body_parameters(3, 1.0)).save(folder / ("motions/G001T000A001R000/" + std::string(person)));
  const ClipPlace clip = inter_x_format().find(Files{folder / "motions"}, {}).at(0);
  const auto refusal = [&](const std::string& bytes) {
    write_file(folder / "annots/interaction_order.pkl", bytes);
    return thrown_message<InputError>([&] { (void)inter_x_format().read(clip, {}); });
  };
  EXPECT_SENTENCE(refusal(test::PickleWriter().raw("}").text("G001T000A001R000").integer(2).raw("s.").str()));
  EXPECT_SENTENCE(refusal("hello"));
}

// From the file to a clip: y up becomes z up, 120 Hz become 50, and the feet stand on the floor.
TEST(InterX, BecomesAClip) {
  const ScratchFolder folder;
  const Eigen::Quaterniond ahead(Eigen::AngleAxisd(0.5 * EIGEN_PI, Eigen::Vector3d::UnitY()));  // faces +x
  const BodyParameters a = test::standing_parameters(121, ahead, {-0.4, 0.9, 0.0});
  const BodyParameters b = test::standing_parameters(121, ahead.conjugate(), {0.4, 0.9, 0.0});
  test::inter_x_npz(a).save(folder / "G001T000A001R000/P1.npz");
  test::inter_x_npz(b).save(folder / "G001T000A001R000/P2.npz");
  const ClipPlace place = inter_x_format().find(Files{folder / ""}, {}).at(0);
  const SourceClip source = clip_of(inter_x_format().read(place, {}));
  const InteractionClip& clip = source.clip;
  EXPECT_EQ(clip.frames(), 51);
  EXPECT_EQ(clip.rate_hz(), 50.0);
  EXPECT_EQ(clip.task, Task::kHandshake);
  EXPECT_NEAR((clip.a.joints.at(0, kPelvis) - clip.b.joints.at(0, kPelvis)).norm(), 0.8, 1e-6);
  EXPECT_GT(clip.a.joints.at(0, kHead).z(), 1.2);
  EXPECT_NEAR(std::min(clip.a.joints.at(0, kLeftToe).z(), clip.a.joints.at(0, kRightToe).z()), 0.02, 0.03);
  // The pelvis' rotation is the identity where somebody stands facing +x (docs/conventions.md); A faces along the line
  // to B.
  const Eigen::Vector3d forward = clip.a.rotations[kPelvis] * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d line = (clip.b.joints.at(0, kPelvis) - clip.a.joints.at(0, kPelvis)).normalized();
  EXPECT_GT(forward.dot(line), 0.999);
  EXPECT_GT((clip.a.rotations[kPelvis] * Eigen::Vector3d::UnitZ()).z(), 0.999);
}

TEST(InterXH5, EachArrayIsAClipWithItsSplitActionAndReactor) {
  const ScratchFolder folder;
  const BodyParameters body = test::body_parameters(3, 1.0);
  const auto array = [&](const std::string& name) {
    return test::Hdf5TestArray{.name = name, .shape = {3, 56, 6}, .values = test::inter_x_h5_values(body, body)};
  };
  write_file(folder / "motions/train.h5",
             test::Hdf5Writer::bytes({array("G001T000A018R005"), array("G001T000A001R000")}));
  write_file(folder / "motions/test.h5", test::Hdf5Writer::bytes({array("G009T001A000R003")}));
  write_file(folder / "annots/interaction_order.pkl",
             test::PickleWriter().raw("}").text("G001T000A001R000").integer(1).raw("s.").str());
  const Files paths = {folder / "motions"};
  ASSERT_TRUE(inter_x_h5_format().recognises(paths));
  const std::vector<ClipPlace> clips = inter_x_h5_format().find(paths, {});
  ASSERT_EQ(clips.size(), 3U);
  EXPECT_EQ(clips[1].id, "G001T000A001R000");
  const RawPeople hug = inter_x_h5_format().read(clips[0], {}), handshake = inter_x_h5_format().read(clips[1], {});
  EXPECT_EQ(hug.task, Task::kHug);
  EXPECT_EQ(hug.source.at("split"), "test");
  EXPECT_EQ(handshake.task, Task::kHandshake);
  EXPECT_EQ(handshake.reactor, Person::kA);
  EXPECT_EQ(handshake.source.at("split"), "train");
  EXPECT_EQ(inter_x_h5_format().read(clips[2], {}).source.at("label"), "Whisper in ear");
}

TEST(InterXH5, ArraysOfOtherShapesAreRefusedAndTheOthersGoOn) {
  const ScratchFolder folder;
  const BodyParameters body = test::body_parameters(3, 1.0);
  const std::vector<double> values = test::inter_x_h5_values(body, body);
  write_file(folder / "test.h5", test::Hdf5Writer::bytes({{.name = "a", .shape = {3, 56, 6}, .values = values},
                                                          {.name = "b", .shape = {3, 6, 56}, .values = values},
                                                          {.name = "c", .shape = {0, 56, 6}, .values = {}},
                                                          {.name = "d", .shape = {18, 56}, .values = values}}));
  const std::vector<ClipPlace> clips = inter_x_h5_format().find(Files{folder / "test.h5"}, {});
  ASSERT_EQ(clips.size(), 4U);
  EXPECT_EQ(inter_x_h5_format().read(clips[0], {}).joints[1].frames(), 3);
  const auto refusal = [&](std::size_t clip) {
    return thrown_message<InputError>([&] { (void)inter_x_h5_format().read(clips[clip], {}); });
  };
  EXPECT_SENTENCE(refusal(1));
  EXPECT_SENTENCE(refusal(2));
  EXPECT_SENTENCE(refusal(3));
  write_file(folder / "empty.h5", test::Hdf5Writer::bytes({}));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)inter_x_h5_format().find(Files{folder / "empty.h5"}, {}); }));
}

// ---- the others ------------------------------------------------------------

TEST(InterHuman, TheRateOfTheFileComesFirst) {
  const ScratchFolder folder;
  const BodyParameters body = test::body_parameters(3, 1.0);
  const auto read = [&](double rate_hz) {
    write_file(folder / "1.pkl", test::interhuman_pickle(body, body, 2, rate_hz));
    return interhuman_raw_format().read({.id = "1", .files = {folder / "1.pkl"}, .entry = ""}, {});
  };
  EXPECT_EQ(read(59.94).rate_hz, 59.94);
  const RawPeople raw = read(0.0);
  EXPECT_EQ(raw.rate_hz, 60.0);
  EXPECT_SENTENCE(raw.evidence);
}

TEST(Amass, BothSpellingsOfTheRateAndObjectsBesideItAreRead) {
  const ScratchFolder folder;
  const BodyParameters body = test::body_parameters(3, 1.0);
  test::amass_poses_npz(body, 60.0, false).save(folder / "a_poses.npz");
  // _stageii.npz keeps dicts beside the motion: nobody looks at them.
  std::vector<ZipEntry> entries = {{"markers_latent_vids.npy", "\x93NUMPY\x01\x00 a pickle that runs os.system"}};
  read_zip(test::amass_poses_npz(body, 60.0, true).bytes(), "b", {.entry_bytes = 1 << 20, .total_bytes = 1 << 20},
           [&](const std::string& entry, const std::string& content) {
             entries.push_back({entry, content});
           });
  write_file(folder / "b_poses.npz", zip_bytes(entries));
  PeopleOptions options;
  options.align = Alignment::kFloor;
  const Files paths = {folder / "a_poses.npz", folder / "b_poses.npz"};
  ASSERT_TRUE(amass_format().recognises(paths));
  EXPECT_EQ(amass_format().read(amass_format().find(paths, options).at(0), options).rate_hz, 60.0);
}

TEST(Amass, AStageIFileIsRefusedByName) {
  const ScratchFolder folder;
  Npz shape;
  shape.set("betas", std::vector<double>(10), {10});
  shape.save(folder / "male_stagei.npz");
  test::amass_stageii_npz(test::body_parameters(3, 1.0)).save(folder / "b_stageii.npz");
  const Files paths = {folder / "male_stagei.npz", folder / "b_stageii.npz"};
  EXPECT_TRUE(amass_format().recognises(paths));
  PeopleOptions options;
  options.align = Alignment::kFloor;
  EXPECT_SENTENCE(thrown_message<InputError>(
      [&] { (void)amass_format().read(amass_format().find(paths, options).at(0), options); }));
}

TEST(Amass, FilesOfTheSameNameInTwoFoldersArePairs) {
  const ScratchFolder folder;
  const BodyParameters body = test::body_parameters(3, 1.0);
  for (const char* name : {"a/s/1_poses.npz", "a/s/2_poses.npz", "b/s/1_poses.npz", "b/s/3_poses.npz", "b/shape.npz"})
    test::amass_poses_npz(body).save(folder / name);
  const std::vector<ClipPlace> clips = amass_format().find(Files{folder / "a", folder / "b"}, {});
  ASSERT_EQ(clips.size(), 1U);
  EXPECT_EQ(clips[0].id, "s-1_poses");
  EXPECT_THAT(clips[0].files, ElementsAre(HasSubstr("a/s/1_poses.npz"), HasSubstr("b/s/1_poses.npz")));
  const auto refusal = [&](const Files& paths) {
    return thrown_message<InputError>([&] { (void)amass_format().find(paths, {}); });
  };
  EXPECT_SENTENCE(refusal({folder / "a"}));
  EXPECT_SENTENCE(refusal({folder / "a", folder / "b/shape.npz"}));
  EXPECT_SENTENCE(refusal({folder / "a/s", folder / "b"}));
}

// Two tracks of one video: frames 3 to 8 are those in which both are there without a break.
TEST(Wham, TheLongestStretchInCommonIsTaken) {
  const ScratchFolder folder;
  const BodyParameters a = test::body_parameters(9, 0.4, 23), b = test::body_parameters(8, 1.9, 23, {1.0, 0.0, 0.0}),
                       c = test::body_parameters(2, 2.5, 23, {0.0, 0.0, 1.0});
  const std::string path = folder / "wham_output.pkl";
  write_file(path, test::wham_pkl({{0, 0, a}, {4, 3, b}, {9, 1, c}}));
  PeopleOptions options;
  options.align = Alignment::kFloor;
  const RawPeople raw = wham_format().read({.id = "x", .files = {path}, .entry = ""}, options);
  EXPECT_SENTENCE(raw.evidence);
  ASSERT_EQ(raw.joints[0].frames(), 6);
  const test::PosedBody whole = test::posed(a, average_body().joints);
  for (int t = 0; t < 6; ++t)
    EXPECT_LT((raw.joints[0].frame(t) - whole.joints[t + 3]).cwiseAbs().maxCoeff(), kSameJoint);
}

TEST(Wham, TwoFramesInCommonAreEnough) {
  const ScratchFolder folder;
  const BodyParameters a = test::body_parameters(4, 0.4, 23), b = test::body_parameters(4, 1.9, 23, {1.0, 0.0, 0.0});
  PeopleOptions options;
  options.align = Alignment::kFloor;
  write_file(folder / "w.pkl", test::wham_pkl({{0, 0, a}, {1, 2, b}}));
  const RawPeople raw = wham_format().read({.id = "x", .files = {folder / "w.pkl"}, .entry = ""}, options);
  EXPECT_EQ(raw.joints[0].frames(), 2);
  EXPECT_SENTENCE(raw.evidence);
}

TEST(Wham, OnePersonAndPeopleWhoNeverMeetAreRefused) {
  const ScratchFolder folder;
  const BodyParameters a = test::body_parameters(4, 0.4, 23);
  PeopleOptions options;
  options.align = Alignment::kFloor;
  const auto refusal = [&](const std::string& bytes) {
    write_file(folder / "w.pkl", bytes);
    return thrown_message<InputError>(
        [&] { (void)wham_format().read({.id = "x", .files = {folder / "w.pkl"}, .entry = ""}, options); });
  };
  EXPECT_SENTENCE(refusal(test::wham_pkl({{0, 0, a}})));
  EXPECT_SENTENCE(refusal(test::wham_pkl({{0, 0, a}, {1, 4, a}})));
  EXPECT_SENTENCE(refusal(test::PickleWriter().raw("].").str()));
  EXPECT_SENTENCE(refusal(test::PickleWriter().raw("}").integer(1).raw("}s.").str()));
}

TEST(FourDHumans, FramesInWhichOneIsMissingEndTheStretch) {
  const ScratchFolder folder;
  const BodyParameters a = test::body_parameters(8, 0.4, 23), b = test::body_parameters(4, 1.9, 23, {1.0, 0.0, 0.0});
  const std::string path = folder / "video.pkl";
  write_file(path, test::phalp_pkl({{1, 0, a}, {2, 2, b}}, 8));
  PeopleOptions options;
  options.align = Alignment::kFloor;
  const RawPeople raw = four_d_humans_format().read({.id = "x", .files = {path}, .entry = ""}, options);
  ASSERT_EQ(raw.joints[0].frames(), 4);
  EXPECT_LT((raw.joints[0].frame(0) - test::posed(a, average_body().joints).joints[2]).cwiseAbs().maxCoeff(),
            kSameJoint);
  EXPECT_SENTENCE(raw.evidence);
}

}  // namespace
}  // namespace duet
