#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/file.h"
#include "duet/report/studies/studies.h"
#include "tests/report/estimates.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using testing::ElementsAre;

// Eight episodes of clips of their own: the headline sees success in the first four; the set `strict` in two of them.
std::vector<EpisodeRow> eight_rows() {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 8; ++i) {
    EpisodeRow row = test::episode("dstar", "hug", 3 * i, i < 4);
    for (const auto& [set, successes] : {std::pair("paper", 4), std::pair("strict", 2)}) {
      Verdict& verdict = row.verdicts.emplace_back();
      verdict.version = "robot";
      verdict.thresholds = set;
      verdict.success = i < successes;
    }
    rows.push_back(row);
  }
  return rows;
}

// A letter per episode: y, n, u, or - for no answer.
Rater rater(const std::string& name, const std::string& letters, const std::vector<EpisodeRow>& rows) {
  Rater made{.name = name, .file = name + ".csv", .answers = {}};
  for (std::size_t i = 0; i < letters.size(); ++i)
    if (letters[i] != '-')
      made.answers[rows[i].key] = letters[i] == 'y' ? Answer::kYes : letters[i] == 'n' ? Answer::kNo : Answer::kUnsure;
  return made;
}

Estimate found_of(const HumanAgreement& agreement, const std::string& of, const char* name) {
  return test::estimate(agreement.analysis, {.of = of, .name = name});
}

TEST(HumanAgreement, OfRatersWhoAgreeWithTheHeadlineIsWhole) {
  const std::vector<EpisodeRow> rows = eight_rows();
  const std::string seen = "yyyynnnn";
  const HumanAgreement found =
      human_agreement(rows, {rater("anna", seen, rows), rater("ben", seen, rows), rater("carla", seen, rows)});
  for (const char* of : {"anna vs ben", "anna vs carla", "ben vs carla", "all raters", "headline vs majority"})
    EXPECT_DOUBLE_EQ(found_of(found, of, "kappa").value, 1.0) << of;
  EXPECT_TRUE(found.disputes.empty());
  // Two of the four that people see: 6 of 8 agreed, half by chance.
  const std::string strict = "robot/strict vs majority";
  EXPECT_DOUBLE_EQ(found_of(found, strict, "kappa").value, 0.5);
  EXPECT_EQ(found_of(found, strict, "sensitivity").k, 2);
  EXPECT_EQ(found_of(found, strict, "sensitivity").n, 4);
  EXPECT_DOUBLE_EQ(found_of(found, strict, "specificity").value, 1.0);
  EXPECT_LT(found_of(found, strict, "specificity").interval.low, 0.6);  // of four clips
}

TEST(HumanAgreement, DisputesAndMajorities) {
  const std::vector<EpisodeRow> rows = eight_rows();
  const HumanAgreement found = human_agreement(
      rows, {rater("anna", "yyyynnn-", rows), rater("ben", "yyuynnn-", rows), rater("carla", "ynnynny-", rows)});
  EXPECT_EQ(found.episodes, 7);
  EXPECT_EQ(found.yes, 3);  // the third has one of each
  EXPECT_EQ(found.no, 3);
  ASSERT_EQ(found.disputes.size(), 3U);
  EXPECT_EQ(found.disputes.at(1).at("episode"), rows[2].key);
  EXPECT_EQ(found.disputes.at(1).at("answers"), (nlohmann::json{{"anna", "yes"}, {"ben", "unsure"}, {"carla", "no"}}));
  const TextTable& disputes = found.analysis.tables.at(2).table;
  EXPECT_THAT(disputes.rows.at(1), ElementsAre(rows[2].key.substr(0, 16), "hug", rows[2].clip, "yes", "unsure", "no"));
  EXPECT_EQ(found_of(found, "headline vs majority", "kappa").n, 6);
  EXPECT_EQ(found_of(found, "headline vs ben", "kappa").n, 6);  // ben's unsure is left out
}

TEST(HumanAgreement, AnEpisodeThatFellIsNoSuccessOfAnyDetector) {
  std::vector<EpisodeRow> rows = eight_rows();
  rows[0].outcome = Outcome::kFell;
  rows[0].success = false;
  const HumanAgreement found = human_agreement(rows, {rater("anna", "yyyynnnn", rows)});
  EXPECT_EQ(found_of(found, "robot/paper vs majority", "sensitivity").k, 3);
}

TEST(HumanAgreement, WhatIsNotAnsweredCountsForNobody) {
  const std::vector<EpisodeRow> rows = eight_rows();
  const HumanAgreement found = human_agreement(rows, {rater("anna", "yyyy----", rows), rater("ben", "--yynnnn", rows)});
  EXPECT_EQ(found_of(found, "anna vs ben", "kappa").n, 2);
  EXPECT_TRUE(std::isnan(found_of(found, "anna vs ben", "kappa").value));  // both say yes to both
  EXPECT_TRUE(test::estimates_like(found.analysis, {.of = "all raters", .name = "kappa"}).empty());
  const std::string text = terminal_text(found.analysis);
  EXPECT_SENTENCE(text);
  const HumanAgreement apart = human_agreement(rows, {rater("anna", "yy------", rows), rater("ben", "--nn----", rows)});
  EXPECT_EQ(found_of(apart, "anna vs ben", "kappa").n, 0);
  EXPECT_TRUE(std::isnan(found_of(apart, "anna vs ben", "kappa").value));
  EXPECT_THROW(human_agreement(rows, {}), std::invalid_argument);
}

class RatingFiles : public testing::Test {
 protected:
  std::string file(const std::string& name, const std::string& text) {
    write_file(folder_ / name, text);
    return folder_ / name;
  }
  std::string refused(const std::vector<std::string>& files) {
    return thrown_message<InputError>([&] { read_ratings(files, rows_, "runs/a"); });
  }
  std::string refused_text(const std::string& text) { return refused({file("a.csv", text)}); }
  [[nodiscard]] std::string line(std::size_t episode, const std::string& rest) const {
    return rows_[episode].key + "," + rest + "\n";
  }
  const std::vector<EpisodeRow> rows_ = eight_rows();
  const std::string header_ = "episode,rater,answer\n";
  test::ScratchFolder folder_;
};

TEST_F(RatingFiles, AreReadAsThePageAndASpreadsheetWriteThem) {
  const std::string page = file("a.csv", header_ + line(0, "\"Anna, B.\",yes") + line(1, "\"Anna, B.\",unsure"));
  const std::string sheet = file("b.csv",
                                 "\xef\xbb\xbf"
                                 "episode;rater;answer\r\n" +
                                     rows_[2].key + ";Ben;no\r\n;;\r\n");
  const std::vector<Rater> raters = read_ratings(std::vector{page, sheet}, rows_, "runs/a");
  ASSERT_EQ(raters.size(), 2U);
  EXPECT_EQ(raters[0].name, "Anna, B.");
  EXPECT_EQ(raters[0].answers.at(rows_[1].key), Answer::kUnsure);
  EXPECT_EQ(raters[1].answers.at(rows_[2].key), Answer::kNo);
}

TEST_F(RatingFiles, AreRefusedWithFileAndLine) {
  EXPECT_SENTENCE(refused_text(""));
  EXPECT_SENTENCE(refused_text("key,answer\n"));
  EXPECT_SENTENCE(refused_text(header_));
  EXPECT_SENTENCE(refused_text(header_ + line(0, "anna,yes") + "0123,anna,yes\n"));
  EXPECT_SENTENCE(refused_text(header_ + "0123,anna,yes\n4567,anna,no\n"));
  for (const char* text : {"anna,yess", "anna,", ",yes", "anna"})
    EXPECT_SENTENCE(refused_text(header_ + line(0, text)));
  EXPECT_SENTENCE(refused_text(header_ + line(0, "anna,yes") + line(1, "ben,yes")));
  EXPECT_SENTENCE(refused_text(header_ + line(0, "anna,yes") + line(0, "anna,no")));
  EXPECT_SENTENCE(refused({folder_ / "none.csv"}));
}

TEST_F(RatingFiles, ARaterHasOneFile) {
  const std::string a = file("a.csv", header_ + line(0, "anna,yes"));
  const std::string b = file("b.csv", header_ + line(1, "anna,no"));
  EXPECT_SENTENCE(refused({a, b}));
  EXPECT_SENTENCE(refused({a, a}));
}

}  // namespace
}  // namespace duet
