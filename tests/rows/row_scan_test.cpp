#include <gmock/gmock.h>

#include "duet/rows/json_fields.h"
#include "duet/rows/row_file.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

std::string line_of(const EpisodeRow& row) { return dumped(to_json(row)); }

std::string refusal_of(const std::string& line) {
  return test::thrown_message<InputError>([&] { static_cast<void>(scan_row(line)); });
}

// The line with a piece of it replaced.
std::string with(std::string line, const std::string& from, const std::string& to) {
  const std::size_t at = line.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return line.replace(at, from.size(), to);
}

TEST(RowScan, FindsWhatTheReaderFinds) {
  EpisodeRow row = test::full_row();
  row.clip = "a \"clip\" of \xC3\xA9t\xC3\xA9 \\ {[";
  row.key = episode_key(row);
  const EpisodeRow scanned = scan_row(line_of(row)).row;
  const EpisodeRow read = row_from_json(parse_json(line_of(row), "row"));
  EXPECT_EQ(scanned.clip, read.clip);
  EXPECT_EQ(scanned.key, read.key);
  EXPECT_EQ(scanned.episode, read.episode);
  EXPECT_EQ(scanned.outcome, read.outcome);
  EXPECT_EQ(scanned.started_at, read.started_at);
  EXPECT_EQ(episode_key(scanned), episode_key(read));
}

TEST(RowScan, FingerprintIsOfAllButWallTimes) {
  const EpisodeRow row = test::full_row();
  EpisodeRow later = row;
  later.started_at = "2027-01-02T03:04:05Z";
  later.wall_s = 99.0;
  later.policy_ms.max = 1.0e3;
  EXPECT_EQ(scan_row(line_of(row)).fingerprint, scan_row(line_of(later)).fingerprint);
  EpisodeRow other = row;
  other.metrics["jpe"] += 1.0e-12;
  EXPECT_NE(scan_row(line_of(row)).fingerprint, scan_row(line_of(other)).fingerprint);
  EXPECT_THAT(differing_fields(row, other), testing::ElementsAre("metrics.jpe"));
}

TEST(RowScan, EachByteOfARowThatRepeatsIsInItsFingerprint) {
  const std::string line = line_of(test::full_row());
  const auto print = scan_row(line).fingerprint;
  int changed = 0;
  for (std::size_t i = 0; i < line.size(); i += 7) {
    if (std::isdigit(static_cast<unsigned char>(line[i])) == 0) continue;
    std::string other = line;
    other[i] = other[i] == '1' ? '2' : '1';
    try {
      if (scan_row(other).fingerprint != print) ++changed;
    } catch (const InputError&) {
      ++changed;  // a digit of a digest or of the schema
    }
  }
  EXPECT_GT(changed, 20);
}

TEST(RowScan, ARowThatIsUsedAgainKeepsNothingOfTheLineBefore) {
  EpisodeRow other = test::episode("replay", "hug", 3, true);
  other.started_at = "2027-01-02T03:04:05Z";
  ScannedRow again = scan_row(line_of(test::full_row()));
  scan_row(line_of(other), again);
  const ScannedRow fresh = scan_row(line_of(other));
  EXPECT_EQ(to_json(again.row), to_json(fresh.row));
  EXPECT_EQ(again.fingerprint, fresh.fingerprint);
}

// Marks are looked for in eight bytes at once: each place of a quote, a bracket and a backslash among them.
TEST(RowScan, FindsTheEndOfATextAndOfAListWhereverTheyStand) {
  for (int filler = 0; filler < 40; ++filler) {
    EpisodeRow row = test::full_row();
    row.message = std::string(filler, 'x') + "\" ] } \\ \\\" [{" + std::string(filler % 8, '{');
    row.clip = std::string(filler, 'y') + "\\\"[" + std::string(filler % 8, ']');
    row.metrics[std::string(filler, 'z') + "}\\"] = filler;
    row.key = episode_key(row);
    const ScannedRow scanned = scan_row(line_of(row));
    EXPECT_EQ(scanned.row.clip, row.clip);
    EXPECT_EQ(scanned.row.key, row.key);
    EXPECT_EQ(scanned.row.task, row.task);
  }
}

TEST(RowScan, RefusesWhatIsNoRow) {
  const std::string line = line_of(test::full_row());
  EXPECT_SENTENCE(refusal_of(""));
  EXPECT_SENTENCE(refusal_of("{}"));
  EXPECT_SENTENCE(refusal_of(line.substr(0, line.size() / 2)));
  EXPECT_SENTENCE(refusal_of(line + "x"));
  EXPECT_SENTENCE(refusal_of(with(line, "\"schema\":5", "\"schema\":4")));
  EXPECT_SENTENCE(refusal_of(with(line, "\"task\":\"hug\"", "\"tusk\":\"hug\"")));
  EXPECT_SENTENCE(refusal_of(with(line, "\"task\":\"hug\"", "\"task\":7")));
  EXPECT_SENTENCE(refusal_of(with(line, "\"episode\":7", "\"episode\":-7")));
  EXPECT_SENTENCE(refusal_of(with(line, "\"outcome\":\"fell\"", "\"outcome\":\"flew\"")));
  EXPECT_SENTENCE(refusal_of(with(line, "\"episode\":7", "\"episode\":8")));
  for (const char* twice : {"\"success\":true", "\"success\":false", "\"outcome\":\"ok\"", "\"wall_s\":1"}) {
    EXPECT_SENTENCE(refusal_of(with(line, "{", std::string("{") + twice + ",")));
    EXPECT_SENTENCE(test::thrown_message<InputError>(
        [&] { row_from_json(parse_json(with(line, "{", std::string("{") + twice + ","), "episode row")); }));
  }
}

}  // namespace
}  // namespace duet
