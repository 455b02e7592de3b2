// `duet import` on the public stand-ins of data sets, as examples/data/README.md says.
#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "duet/archives/npy/npz.h"
#include "duet/motion/interaction_clip.h"
#include "tests/app/program.h"

namespace duet {
namespace {

using test::Answer;
using test::duet_program;
using ::testing::HasSubstr;

const std::string kRoot = DUET_SOURCE_DIR;
const std::string kData = kRoot + "/examples/data";

TEST(ImportCommand, EveryLineOfTheReadmeRuns) {
  const test::ScratchFolder folder;
  std::filesystem::create_directories(folder / "examples");
  std::filesystem::create_directory_symlink(kData, folder / "examples/data");
  std::istringstream lines(read_file(kData + "/README.md"));
  int run = 0;
  for (std::string line; std::getline(lines, line);) {
    const std::size_t begin = line.find("`duet import ");
    if (begin == std::string::npos) continue;
    const std::string arguments = line.substr(begin + 6, line.find('`', begin + 1) - begin - 6);
    const Answer answer = duet_program(arguments, "cd " + (folder / "") + ";");
    EXPECT_EQ(answer.code, 0) << arguments << "\n" << answer.err;
    ++run;
  }
  EXPECT_EQ(run, 10);
  int clips = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "clips")) {
    EXPECT_GE(load_clip(entry.path().string()).frames(), 2) << entry.path();
    ++clips;
  }
  EXPECT_EQ(clips, 6);
}

TEST(ImportCommand, TheVerdictSaysWhatWasFound) {
  const test::ScratchFolder folder;
  const Answer answer = duet_program("import " + kData + "/kinect/recording.npz -o " + (folder / "clip.npz"));
  EXPECT_EQ(answer.code, 0) << answer.err;
  for (const char* sentence :
       {"format: positions", "skeleton: kinect-15 (by the names of the joints)", "unit: 0.001 m, millimetre",
        "up axis: +y", "mirror: no", "level: kept", "floor: at -1.", "phases: act"})
    EXPECT_THAT(answer.out, HasSubstr(sentence));
  const InteractionClip clip = load_clip(folder / "clip.npz");
  EXPECT_EQ(clip.task, Task::kHandshake);
  EXPECT_EQ(clip.source.at("label"), "shaking_hands");
}

TEST(ImportCommand, ListsChoosesAndCounts) {
  const test::ScratchFolder folder;
  std::filesystem::create_directories(folder / "in");
  for (const char* name : {"x.npz", "y.npz"})
    std::filesystem::copy(kData + "/kinect/recording.npz", folder / (std::string("in/") + name));
  const auto listed = nlohmann::json::parse(duet_program("import --json --list " + (folder / "in")).out);
  EXPECT_EQ(listed.at("clips").size(), 2U);
  EXPECT_EQ(listed.at("format"), "positions");
  const std::string both = "import -q " + (folder / "in");
  EXPECT_THAT(duet_program(both + " -o " + (folder / "one.npz")).err, HasSubstr("name one with --clip"));
  EXPECT_EQ(duet_program(both + " --clip y -o " + (folder / "one.npz")).code, 0);
  EXPECT_EQ(load_clip(folder / "one.npz").id, "y");
  EXPECT_THAT(duet_program(both + " --clip z -o " + (folder / "one.npz")).err, HasSubstr("unknown clip 'z'"));
  Npz three;
  three.set("positions", std::vector<double>(8 * 3 * 15 * 3), {8, 3, 15, 3});
  three.save(folder / "in/x.npz");
  const Answer answer = duet_program("import --json " + (folder / "in") + " -o " + (folder / "out"));
  EXPECT_EQ(answer.code, 0) << answer.err;
  const auto report = nlohmann::json::parse(answer.out);
  EXPECT_EQ(report.at("clips").size(), 1U);
  EXPECT_THAT(report.at("refused").at(0).at("reason").get<std::string>(), HasSubstr("found (8, 3, 15, 3)"));
  std::filesystem::remove(folder / "in/y.npz");
  EXPECT_THAT(duet_program(both + " -o " + (folder / "none")).err, HasSubstr("none of 1 clips was imported"));
}

TEST(ImportCommand, OptionsThatAreWrongAreOneSentence) {
  const std::string npz = kData + "/kinect/recording.npz", out = " -o /dev/null/x.npz";
  for (const auto& [arguments, sentence] : std::vector<std::pair<std::string, std::string>>{
           {npz + " --up w" + out, "--up: expected x, y, z, +y, +z, -x, -y, -z, found 'w'"},
           {npz + " --mirror --no-mirror" + out, "--mirror and --no-mirror exclude each other"},
           {npz + " --level --no-level" + out, "exclude each other"},
           {npz + " --format inter-y" + out, "did you mean 'inter-x"},
           {npz + " --skeleton coco-17" + out, "expected the 17 joints of 'coco-17', found 15"},
           {npz, "--output is needed"},
           {npz + " --robot C" + out, "--robot: expected A, B, found 'C'"},
           {kData + "/README.md" + out, "no motion of two people that is known"}}) {
    const Answer answer = duet_program("import -q " + arguments);
    EXPECT_EQ(answer.code, 2) << arguments;
    EXPECT_THAT(answer.err, HasSubstr(sentence)) << arguments;
  }
}

// The reader that fits best speaks: a table of a robot's numbers with a nan in it is no table of people without names.
TEST(ImportCommand, WhatIsWrongInATableIsSaidByTheReaderThatFits) {
  const test::ScratchFolder folder;
  std::string table;
  for (int row = 1; row <= 50; ++row) {
    table += row == 41 ? "nan" : "0";
    table += ",0,0.79,0,0,0,1";
    for (int joint = 0; joint < 29; ++joint) table += ",0";
    table += "\n";
  }
  write_file(folder / "robot.csv", table);
  EXPECT_THAT(duet_program("import -q " + (folder / "robot.csv") + " -o /dev/null/x.npz").err,
              HasSubstr("robot.csv': line 41: column 1: expected a finite number, found 'nan'"));
  write_file(folder / "people.csv", "time,a_head_x,a_head_y,b_head_x,b_head_y\n0,1,2,3,word\n");
  EXPECT_THAT(duet_program("import -q " + (folder / "people.csv") + " -o /dev/null/x.npz").err,
              HasSubstr("joint 'head' of person A has no column for z"));
  write_file(folder / "pointer.onnx", "version https://git-lfs.github.com/spec/v1\n");
  EXPECT_THAT(duet_program("import -q " + (folder / "pointer.onnx") + " -o /dev/null/x.npz").err,
              HasSubstr("pointer.onnx': this is a Git LFS pointer"));
}

TEST(ImportCommand, FormatsAndSkeletonsAreListed) {
  const auto formats = nlohmann::json::parse(duet_program("list people-formats --json").out);
  EXPECT_THAT(formats.dump(), HasSubstr("inter-x-skeleton"));
  const auto layouts = nlohmann::json::parse(duet_program("list joint-layouts --json").out);
  EXPECT_THAT(layouts.dump(), HasSubstr("optitrack-64"));
}

}  // namespace
}  // namespace duet
