#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/datasets/dataset.h"
#include "duet/datasets/dataset_card.h"
#include "duet/datasets/entry.h"
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

DatasetEntry sample() {
  return {.clip = "s01-hug",
          .key = "abc",
          .status = ClipStatus::kRejected,
          .gates = {"motion fidelity"},
          .reasons = {"fastest joint: 14 m/s, expected at most 8 (frame 3)"},
          .format = "positions",
          .licence = "research",
          .label = "hugging",
          .sources = {{"s01.npz", "00ff"}},
          .evidence = {"unit: metre"},
          .provenance = {{"phases", "proposed"}},
          .task = "hug",
          .reactor = "B",
          .frames = 120,
          .act_begin = 0.5,
          .act_end = 1.5,
          .statistics = {.seconds = 2.4, .contact_ratio = 0.25},
          .criteria = {{"joint_speed", 14.0}},
          .outputs = {{"rejected/s01-hug.svg", "11"}},
          .metrics = {{"g1", {{"jpe", 0.05}, {"contact_f1_0.2", std::nan("")}}}}};
}

TEST(DatasetEntry, ALineIsReadBackAsItWas) {
  const std::string line = entry_line(sample());
  EXPECT_EQ(line.find('\n'), std::string::npos);
  const DatasetEntry read = parse_entry(line, "line");
  EXPECT_EQ(entry_line(read), line);
  EXPECT_EQ(read.status, ClipStatus::kRejected);
  EXPECT_EQ(read.sources, sample().sources);
  EXPECT_EQ(read.statistics.contact_ratio, 0.25);
  EXPECT_TRUE(std::isnan(read.metrics.at("g1").at("contact_f1_0.2")));
}

TEST(DatasetEntry, WhatIsNoEntryIsRefusedByName) {
  const auto refusal = [](const std::string& line) -> std::string {
    try {
      (void)parse_entry(line, "'entries.jsonl', line 4");
    } catch (const InputError& error) {
      return error.what();
    }
    return "(taken)";
  };
  EXPECT_SENTENCE(refusal("{"));
  EXPECT_SENTENCE(refusal("{}"));
  std::string line = entry_line(sample());
  line.replace(line.find("\"rejected\""), 10, "\"refused!\"");
  EXPECT_SENTENCE(refusal(line));
  line = entry_line(sample());
  line.insert(1, "\"more\":1,");
  EXPECT_SENTENCE(refusal(line));
}

}  // namespace
}  // namespace duet
