#include <gmock/gmock.h>

#include <filesystem>
#include <map>
#include <set>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/policies/language.h"
#include "duet/replay/replay_page.h"
#include "tests/app/program.h"
#include "tests/execution/verified_run.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::vector<EpisodeRow> thirty_rows() {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 30; ++i) {
    EpisodeRow& row = rows.emplace_back();
    row.task = i < 20 ? "hug" : "wave";
    row.key = "key" + std::to_string(i);
  }
  return rows;
}

std::vector<std::string> keys_drawn(const std::vector<EpisodeRow>& rows, int count, std::uint64_t seed) {
  std::vector<const EpisodeRow*> all;
  for (const EpisodeRow& row : rows) all.push_back(&row);
  std::vector<std::string> keys;
  for (const EpisodeRow* row : rated_rows(all, count, seed)) keys.push_back(row->key);
  return keys;
}

TEST(RatedRows, DependOnTheSeedAndNotOnTheOrderOfRows) {
  std::vector<EpisodeRow> rows = thirty_rows();
  const std::vector<std::string> drawn = keys_drawn(rows, 12, 7);
  EXPECT_NE(keys_drawn(rows, 12, 8), drawn);
  std::ranges::reverse(rows);
  EXPECT_EQ(keys_drawn(rows, 12, 7), drawn);
  EXPECT_EQ(std::set(drawn.begin(), drawn.end()).size(), 12U);
}

TEST(RatedRows, AreAboutAsManyOfEachTask) {
  const std::vector<EpisodeRow> rows = thirty_rows();
  std::map<std::string, int> tasks;
  std::vector<std::string> order;
  for (const std::string& key : keys_drawn(rows, 12, 7)) {
    order.push_back(rows[static_cast<std::size_t>(std::stoi(key.substr(3)))].task);
    ++tasks[order.back()];
  }
  EXPECT_EQ(tasks["hug"], 6);
  EXPECT_EQ(tasks["wave"], 6);
  EXPECT_FALSE(std::ranges::is_sorted(order));  // and mixed
  EXPECT_EQ(keys_drawn(rows, 100, 7).size(), 30U);
}

using DuetRun = Run;  // testing::Test has one of its own

class RatingPage : public testing::Test {
 protected:
  DuetRun run(const std::string& record) {
    Suite suite = test::playback_suite();
    suite.record = record == "all" ? RecordTrajectories::kAll : RecordTrajectories::kNone;
    test::make_run(suite, folder_ / record);
    return load_run(folder_ / record);
  }
  static ReplayContent content(const DuetRun& run, const RatingChoice& choice = {}) {
    Progress quiet(Progress::Style::kQuiet);
    return rating_content(run, choice, quiet);
  }
  test::ScratchFolder folder_;
};

TEST_F(RatingPage, HoldsTheMotionsAndTheTaskInWords) {
  const DuetRun kept = run("all");
  const ReplayContent shown = content(kept);
  ASSERT_EQ(shown.scenes.size(), kept.rows.size());
  for (const ReplayScene& scene : shown.scenes) {
    const auto row = std::ranges::find(kept.rows, scene.id, &EpisodeRow::key);
    ASSERT_NE(row, kept.rows.end());
    EXPECT_EQ(scene.name, task_prompt(parse_task(row->task)));
    ASSERT_EQ(scene.tracks.size(), 1U);
    EXPECT_EQ(scene.tracks[0].frames(), row->frames);
    EXPECT_FALSE(scene.tracks[0].recording.partner.empty());
  }
  EXPECT_EQ(content(kept, {.count = 1}).scenes.size(), 1U);
}

TEST_F(RatingPage, IsBlindInItsDataToo) {
  const DuetRun kept = run("all");
  const std::string data = replay_data(content(kept));
  for (const EpisodeRow& row : kept.rows) {
    EXPECT_THAT(data, HasSubstr(row.key));
    for (const std::string& told : {row.clip, row.engine, row.policy_digest, row.state_hash, row.suite_hash}) {
      if (told.empty()) continue;
      EXPECT_THAT(data, Not(HasSubstr(told)));
    }
  }
  for (const char* told :
       {"\"row\"", "success\":true", "\"margins\"", "\"null arm\"", "kept by the run", "wave/", "\"pd\""})
    EXPECT_THAT(data, Not(HasSubstr(told)));
  const std::string page = rating_page(content(kept), {.script = "", .style = ""});
  EXPECT_THAT(page,
              AllOf(HasSubstr("<title>Rating</title>"), Not(HasSubstr("playback")), Not(HasSubstr(folder_ / "all"))));
}

TEST_F(RatingPage, NeedsARunThatKeptItsTrajectories) {
  const DuetRun none = run("none");
  EXPECT_THAT(thrown_message<InputError>([&] { content(none); }),
              AllOf(HasSubstr(none.path), HasSubstr("kept trajectories (record.trajectories: all in its suite)")));
}

std::string csv_of(const DuetRun& run, const std::string& rater, const std::string& answer) {
  std::string text = "episode,rater,answer\n";
  for (const EpisodeRow& row : run.rows) text += row.key + "," + rater + "," + answer + "\n";
  return text;
}

TEST_F(RatingPage, TheCommandsSayWhatTheyCannotUse) {
  const DuetRun none = run("none");
  const test::Answer blank = test::duet_program("rate " + none.path + " -o " + (folder_ / "a.html"));
  EXPECT_EQ(blank.code, 2);
  EXPECT_THAT(blank.err, HasSubstr("duet: '" + none.path + "': expected a run of interactions that kept trajectories"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.html"));
  write_file(folder_ / "a.csv", csv_of(none, "anna", "yes"));
  write_file(folder_ / "b.csv", csv_of(none, "ben", "maybe"));
  const test::Answer word =
      test::duet_program("agree " + none.path + " " + (folder_ / "a.csv") + " " + (folder_ / "b.csv"));
  EXPECT_EQ(word.code, 2);
  EXPECT_THAT(word.err, HasSubstr("line 2: unknown answer 'maybe'"));
  EXPECT_EQ(word.out, "");
  const test::Answer twice =
      test::duet_program("agree " + none.path + " " + (folder_ / "a.csv") + " " + (folder_ / "a.csv"));
  EXPECT_EQ(twice.code, 2);
  EXPECT_THAT(twice.err, HasSubstr("found 'anna' again"));
}

TEST_F(RatingPage, AgreeTellsRatersAndDetectors) {
  const DuetRun none = run("none");  // ratings need no recordings
  write_file(folder_ / "a.csv", csv_of(none, "anna", "yes"));
  write_file(folder_ / "b.csv", csv_of(none, "ben", "no"));
  const std::string files = none.path + " " + (folder_ / "a.csv") + " " + (folder_ / "b.csv");
  const test::Answer text = test::duet_program("agree " + files);
  EXPECT_EQ(text.code, 0) << text.err;
  EXPECT_THAT(text.out, AllOf(HasSubstr("anna, ben"), HasSubstr("headline"), HasSubstr("Episodes in dispute (4)")));
  const nlohmann::json json = nlohmann::json::parse(test::duet_program("agree --json " + files).out);
  EXPECT_EQ(json.at("disputes").size(), none.rows.size());
  EXPECT_EQ(json.at("majority").at("yes"), 0);
}

}  // namespace
}  // namespace duet
