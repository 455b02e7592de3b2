// Rows that are held lean make the tables of whole rows, in a bounded part of the memory.
#include "duet/rows/row_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <malloc.h>

#include <fstream>

#include "duet/core/file.h"
#include "duet/report/page/run_analyses.h"
#include "duet/report/page/training_curves.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/merge/row_merge.h"
#include "duet/rows/row_file.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

// As an episode of some seconds leaves it.
EpisodeRow real_row(const std::string& engine, int number) {
  EpisodeRow row = test::full_row();
  const EpisodeRow tiny = test::episode("replay", "hug", number, number % 3 == 0);
  row.suite = tiny.suite;
  row.suite_version = tiny.suite_version;
  row.suite_hash = tiny.suite_hash;
  row.policy = tiny.policy;
  row.policy_digest = row.controller_digest = row.profile_digest = "";
  row.controller = tiny.controller;
  row.arm = "main";
  row.perturbation = "clean";
  row.outcome = number % 5 == 0 ? Outcome::kFell : Outcome::kOk;
  row.success = tiny.success;
  row.task = tiny.task;
  row.clip = tiny.clip;
  row.episode = number;
  row.engine = engine;
  row.verdicts.resize(4, row.verdicts.front());
  row.verdicts[1].thresholds = "paper";
  row.verdicts[2].version = "robot";
  row.verdicts[3].version = "robot";
  row.verdicts[3].thresholds = "paper";
  for (int i = 0; i < 20; ++i) row.metrics["a_metric_with_a_long_name_" + std::to_string(i)] = 0.01 * (number + i);
  row.trace.mm.clear();
  for (int frame = 0; frame < 100; ++frame)
    row.trace.mm.push_back({frame * (engine == "ode" ? 2 : 1), 0, 790, 210, 180, 900 + number % 7});
  row.state_hash = std::string(50, 'c') + engine + std::to_string(number);
  row.key = episode_key(row);
  return row;
}

class LeanRows : public testing::Test {
 protected:
  LeanRows() { RunDirectory::open(path_, test::tiny_run()); }
  void write(const std::vector<EpisodeRow>& rows) const {
    std::string text;
    for (const EpisodeRow& row : rows) text += dumped(to_json(row)) + "\n";
    write_file(path_ + "/episodes.jsonl", text);
  }
  [[nodiscard]] std::string report(RowExtent extent) const {
    duet::Run run = united({load_run(path_, extent)});
    std::vector<EpisodeRow> rows = std::move(run.rows);
    const RunTables tables = run_tables(std::move(rows), {}, nullptr, run.file);
    std::string text = run_text(run_analyses(tables));
    for (const Analysis& analysis : run_analyses(tables))
      text += dumped(analysis_json(analysis), 1) + analysis_markdown(analysis);
    for (const LinePlot& plot : foot_plots(tables.rows, tables.file))
      for (const auto& series : plot.series) text += fmt::format("{} {}\n", plot.title, fmt::join(series.y, " "));
    return text;
  }

  test::ScratchFolder folder_;
  std::string path_ = folder_ / "run";
};

// As the rule interaction judges: which condition failed is a table.
void judge_by_rule(EpisodeRow& row) {
  Verdict& rule = row.verdicts.emplace_back();
  rule.version = "interaction";
  rule.thresholds = "act";
  rule.success = row.success.value_or(false);
  rule.parts = {{"act", true}, {"reply", rule.success}};
  rule.values = {{"lead_s", 0.1 * row.episode}};
}

TEST_F(LeanRows, MakeTheTablesOfWholeRows) {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 12; ++i)
    for (const char* engine : {"mujoco", "ode"}) rows.push_back(real_row(engine, i));
  rows[3].feet = {};
  for (EpisodeRow& row : rows) judge_by_rule(row);
  write(rows);
  const std::string whole = report(RowExtent::kWhole);
  EXPECT_EQ(report(RowExtent::kLean), whole);
  EXPECT_THAT(whole, HasSubstr("ode"));
  EXPECT_THAT(whole, HasSubstr("What failed episodes lack"));
  EXPECT_EQ(load_run(path_, RowExtent::kLean).rows[0].trace.mm.size(), 0U);
}

TEST_F(LeanRows, AreReadWholeWhereTwoWouldHaveToBeCompared) {
  std::vector<EpisodeRow> rows = {real_row("mujoco", 0), real_row("mujoco", 1), real_row("mujoco", 0)};
  rows[2].wall_s = 7.0;
  write(rows);
  EXPECT_EQ(load_run(path_, RowExtent::kLean).warnings.size(), 1U);
  rows[2].contacts.clear();  // what lean rows do not hold
  write(rows);
  EXPECT_THAT(test::thrown_message<InputError>([&] { load_run(path_, RowExtent::kLean); }),
              HasSubstr("differs (contacts"));
}

TEST_F(LeanRows, AreNamedWithTheirLineWhereTheyAreBroken) {
  write({real_row("mujoco", 0), real_row("mujoco", 1)});
  std::string text = read_file(path_ + "/episodes.jsonl");
  text.replace(text.rfind("\"key\":\"") + 8, 4, "0000");
  write_file(path_ + "/episodes.jsonl", text);
  for (const RowExtent extent : {RowExtent::kWhole, RowExtent::kLean})
    EXPECT_THAT(test::thrown_message<InputError>([&] { load_run(path_, extent); }),
                HasSubstr("episodes.jsonl:2: key 'key': expected"));
}

TEST_F(LeanRows, AFileThatWasReplacedMeanwhileIsNamed) {
  write({real_row("mujoco", 0), real_row("mujoco", 1)});
  const duet::Run run = load_run(path_, RowExtent::kLean);
  EXPECT_EQ(run.file.trace(run.rows[1]).mm.size(), 100U);
  std::ofstream(path_ + "/episodes.jsonl", std::ios::trunc) << "{}\n";
  EXPECT_THAT(test::thrown_message<InputError>([&] { static_cast<void>(run.file.trace(run.rows[1])); }),
              HasSubstr("changed while it was read"));
}

// docs/performance.md, "Measured".
TEST_F(LeanRows, TakeLittleMemoryEach) {
  constexpr int kRows = 2000;
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < kRows; ++i) rows.push_back(real_row("mujoco", i));
  write(rows);
  rows = {};
  const auto used = [] { return static_cast<double>(mallinfo2().uordblks + mallinfo2().hblkhd); };
  const double before = used();
  const duet::Run run = load_run(path_, RowExtent::kLean);
  EXPECT_LT((used() - before) / static_cast<double>(kRows), 2400.0);  // whole rows: some 15,000
  EXPECT_EQ(run.rows.size(), static_cast<std::size_t>(kRows));
}

TEST(RowScan, LeavesMembersOutOfALine) {
  const std::string line = R"({"a":[1,{"b":"]"}],"c" : {"a":2}, "d":"x"})";
  constexpr std::string_view kNames[] = {"a", "c"};
  EXPECT_EQ(without_members(line, kNames), R"({"a":[],"c" : null, "d":"x"})");
  EXPECT_EQ(scan_member(line, "c"), R"({"a":2})");
  EXPECT_EQ(scan_member(line, "e"), "");
}

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
