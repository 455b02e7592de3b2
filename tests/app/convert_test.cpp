#include "duet/parts/data/convert.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/paired_motion.h"
#include "duet/retarget/solver/pair.h"
#include "tests/app/program.h"
#include "tests/formats/known_motion.h"
#include "tests/motion/people.h"

namespace duet {
namespace {

using test::Answer;
using test::duet_program;
using test::ScratchFolder;
using test::thrown_message;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const RobotModel& g1() {
  static const RobotModel robot = load_robot(card_path("g1"));
  return robot;
}

PairedMotion paired(int frames = 60) {
  PairedMotion motion;
  motion.clip_id = "x";
  motion.phases = {.act_begin = 20, .act_end = 40};
  motion.robot = test::known_motion(g1(), frames);
  motion.partner = test::moving_person(frames, 50.0, {1.0, 0.0, 0.0});
  motion.source_partner = motion.partner;
  motion.source_reactor = test::moving_person(frames, 50.0, {0.0, 0.0, 0.0});
  return motion;
}

TEST(Convert, APairedMotionGivesItsRobotAndSaysThatThePartnerStays) {
  const ScratchFolder folder;
  save_paired_motion(paired(), folder / "in.npz");
  const ConvertedMotion made = convert_motion(folder / "in.npz", folder / "out.pkl", g1(), {.to = "gmr"});
  EXPECT_THAT(made.evidence, Contains("the partner stays behind: robot motions hold no person"));
  EXPECT_EQ(made.frames, 60);
  const RobotMotionFile back = read_robot_motion(folder / "out.pkl", g1());
  EXPECT_LT(test::distance(back.motion, paired().robot), 1e-9);
}

TEST(Convert, SimToRealIsAlgorithmSevenOnPairedMotions) {
  const ScratchFolder folder;
  save_paired_motion(paired(), folder / "in.npz");
  const PairedMotion expected = prepare_for_real(paired(), g1());
  ConversionOptions options{.to = "paired"};
  options.sim_to_real = true;
  (void)convert_motion(folder / "in.npz", folder / "out.npz", g1(), options);
  const PairedMotion kept = load_paired_motion(folder / "out.npz");
  EXPECT_EQ(kept.robot.q, expected.robot.q);
  EXPECT_EQ(kept.settings.at("prepared"), "sim_to_real");
  options.to = "gmr";
  (void)convert_motion(folder / "in.npz", folder / "out.pkl", g1(), options);
  EXPECT_LT(test::distance(read_robot_motion(folder / "out.pkl", g1()).motion, expected.robot), 1e-9);
  EXPECT_THAT(
      thrown_message<InputError>([&] { (void)convert_motion(folder / "out.pkl", folder / "x.pkl", g1(), options); }),
      HasSubstr("out.pkl': expected a paired motion (`duet retarget`) to prepare for the real robot"));
  EXPECT_THAT(
      thrown_message<InputError>([&] { (void)convert_motion(folder / "out.npz", folder / "x.pkl", g1(), options); }),
      HasSubstr("is prepared already"));
}

TEST(Convert, ResamplingIsSaid) {
  const ScratchFolder folder;
  save_paired_motion(paired(51), folder / "in.npz");
  const ConvertedMotion made = convert_motion(folder / "in.npz", folder / "out.csv", g1(), {.to = "unitree"});
  EXPECT_EQ(made.rate_hz, 30.0);
  EXPECT_EQ(made.frames, 31);
  EXPECT_THAT(made.evidence, Contains("resampled: 51 frames at 50 Hz -> 31 frames at 30 Hz"));
}

TEST(Convert, FoldersAreSearchedAndFoldersOfAMotionAreMotions) {
  const ScratchFolder folder;
  const RobotMotion motion = test::known_motion(g1());
  write_robot_motion(motion, g1(), robot_motion_format("gmr"), folder / "set/b.pkl");
  write_robot_motion(motion, g1(), robot_motion_format("sonic"), folder / "set/deep/walk");
  write_file(folder / "set/notes.md", "no motion");
  EXPECT_THAT(find_robot_motions({folder / "set"}), ElementsAre(folder / "set/b.pkl", folder / "set/deep/walk"));
  EXPECT_THAT(thrown_message<InputError>([&] { (void)find_robot_motions({folder / "none"}); }),
              HasSubstr("none': No such file or directory"));
  std::filesystem::create_directory(folder / "empty");
  EXPECT_THAT(thrown_message<InputError>([&] { (void)find_robot_motions({folder / "empty"}); }),
              HasSubstr("empty': expected robot motions, found none"));
}

TEST(Convert, OutputsAreNamedAfterTheirInputs) {
  EXPECT_THAT(converted_paths({"a/x.npz"}, "out/y.pkl", "gmr"), ElementsAre("out/y.pkl"));
  EXPECT_THAT(converted_paths({"a/x.npz"}, "out", "gmr"), ElementsAre("out/x.pkl"));
  EXPECT_THAT(converted_paths({"a/x.npz"}, "out/walk", "sonic"), ElementsAre("out/walk"));
  EXPECT_THAT(converted_paths({"a/x.npz", "a/walk/"}, "out", "paired"), ElementsAre("out/x.npz", "out/walk.npz"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([] {
                (void)converted_paths({"a/x.npz", "b/x.csv"}, "out", "gmr");
              }),
              HasSubstr("'b/x.csv': another input would be written to 'out/x.pkl' too"));
}

TEST(Convert, TheCommandReadsWhatImportReadsAndSaysHow) {
  const ScratchFolder folder;
  write_robot_motion(test::known_motion(g1()), g1(), robot_motion_format("unitree"), folder / "walk.csv");
  const Answer csv = duet_program("convert -q " + (folder / "walk.csv") + " -o " + (folder / "walk.npz") +
                                  " --to beyondmimic --order depth-first --rate 50");
  ASSERT_EQ(csv.code, 0) << csv.err;
  EXPECT_THAT(csv.out, HasSubstr("root rotation: xyzw (as documented)"));
  EXPECT_EQ(Npz::load(folder / "walk.npz").text("order"), "depth-first");
  const Answer import = duet_program("import -q " + (folder / "walk.npz") + " -o " + (folder / "recording.npz"));
  ASSERT_EQ(import.code, 0) << import.err;
  EXPECT_THAT(import.out, HasSubstr("format: beyondmimic (by its content)"));
  EXPECT_THAT(import.out, HasSubstr("its body positions and our kinematics differ by"));
}

TEST(Convert, TheCommandRefusesInOneSentence) {
  const ScratchFolder folder;
  const std::string csv = folder / "walk.csv";
  write_robot_motion(test::known_motion(g1()), g1(), robot_motion_format("unitree"), csv);
  for (const auto& [options, sentence] :
       {std::pair<std::string, std::string>{"--to phuma", "--to: format 'phuma' is read, not written"},
        {"--to gmrr", "did you mean 'gmr'?"},
        {"--to gmr --prepare real", "--prepare: expected sim-to-real, found 'real'"},
        {"--to gmr --prepare sim-to-real", "expected a paired motion"},
        {"--to gmr --quaternion xywz", "unknown order of quaternions 'xywz'"},
        {"--to beyondmimic --order depth", "unknown order 'depth'"}}) {
    const Answer answer = duet_program("convert -q " + csv + " -o " + (folder / "out") + " " + options);
    EXPECT_EQ(answer.code, 2) << options;
    EXPECT_THAT(answer.err, HasSubstr(sentence)) << options;
  }
}

TEST(Convert, TheFormatsAreListed) {
  const Answer answer = duet_program("list robot-formats");
  for (const std::string& name : robot_motion_format_names()) EXPECT_THAT(answer.out, HasSubstr(name + " "));
}

}  // namespace
}  // namespace duet
