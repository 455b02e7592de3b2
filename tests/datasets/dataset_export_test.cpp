#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/datasets/dataset.h"
#include "duet/datasets/dataset_card.h"
#include "duet/motion/paired_motion.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/datasets/recordings.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

class DatasetExportTest : public ::testing::Test {
 protected:
  DatasetExportTest() {
    test::write_recording(folder_ / "in/a.npz", synthesize(Task::kHandshake, {.seed = 1}), "handshake");
    test::write_recording(folder_ / "in/b.npz", synthesize(Task::kWave, {.seed = 2}), "waving");
    test::write_recording(folder_ / "in/c.npz", synthesize(Task::kWave, {.seed = 3}), "hugging");  // is refused
    make_dataset({.inputs = {folder_ / "in"}, .robots = robots_, .pair = test::quick_pair()}, data_);
  }

  DatasetExport run(const std::string& format = "gmr", const RobotMotionWriting& writing = {}) {
    return export_dataset(data_, out_, robots_, robot_motion_format(format), writing, 2);
  }
  nlohmann::json manifest() const { return nlohmann::json::parse(read_file(out_ + "/manifest.json")); }

  test::ScratchFolder folder_;
  std::vector<DatasetRobot> robots_ = {{.name = "g1", .model = load_shared_robot()}};
  std::string data_ = folder_ / "data", out_ = folder_ / "out";
};

TEST_F(DatasetExportTest, EachKeptMotionIsWrittenAndReadsBackAsItWas) {
  EXPECT_EQ(run().motions, 2);
  const RobotMotionFile read = read_robot_motion(out_ + "/g1/a.pkl", *robots_[0].model);
  const PairedMotion paired = load_paired_motion(data_ + "/" + robot_file("g1", "a"));
  ASSERT_EQ(read.motion.frames(), paired.robot.frames());
  EXPECT_LT((read.motion.q - paired.robot.q).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_FALSE(fs::exists(out_ + "/g1/c.pkl"));
}

TEST_F(DatasetExportTest, TheManifestSaysWhatCameOfWhat) {
  run("unitree", {.rate_hz = 30.0});
  const nlohmann::json rows = manifest();
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0]["clip"], "a");
  EXPECT_EQ(rows[0]["task"], "handshake");
  EXPECT_EQ(rows[0]["rate_hz"], 30.0);
  EXPECT_EQ(rows[0]["source"]["sha256"], sha256_file(data_ + "/" + robot_file("g1", "a")));
  const std::string file = rows[0]["files"][0]["file"];
  EXPECT_EQ(rows[0]["files"][0]["sha256"], sha256_file(out_ + "/" + file));
}

TEST_F(DatasetExportTest, WhatIsThereIsNotWrittenAgainAndWhatIsBrokenIs) {
  run();
  EXPECT_EQ(run().from_before, 2);
  write_file(out_ + "/g1/a.pkl", "else");
  EXPECT_EQ(run().from_before, 1);
  EXPECT_EQ(manifest()[0]["files"][0]["sha256"], sha256_file(out_ + "/g1/a.pkl"));
  EXPECT_EQ(run("gmr", {.rate_hz = 30.0}).from_before, 0);  // another way of writing
}

TEST_F(DatasetExportTest, AFormatOfSeveralFilesIsAFolder) {
  run("sonic");
  EXPECT_TRUE(fs::exists(out_ + "/g1/a/joint_pos.csv"));
  EXPECT_GT(manifest()[0]["files"].size(), 3U);
}

TEST_F(DatasetExportTest, AMotionThatWasChangedIsRefused) {
  write_file(data_ + "/" + robot_file("g1", "a"), "else");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { run(); }));
}

TEST_F(DatasetExportTest, WhatCannotBeIsRefusedByName) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { run("phuma"); }));
  robots_[0].name = "other";
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { run(); }));
  data_ = folder_ / "in";
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { run(); }));
}

}  // namespace
}  // namespace duet
