#include "duet/datasets/entry.h"

#include <gtest/gtest.h>

#include <cmath>

#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

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
