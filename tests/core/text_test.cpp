#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "duet/core/require.h"

namespace duet {
namespace {

using ::testing::ElementsAre;

TEST(Shown, LeavesPlainTextAlone) {
  EXPECT_EQ(excerpt(""), "");
  EXPECT_EQ(excerpt("hug 17_04 'x'"), "hug 17_04 'x'");
  EXPECT_EQ(excerpt("ü 日本 🤝"), "ü 日本 🤝");
}

TEST(Shown, EscapesWhatMovesOrRecoloursTheTerminal) {
  EXPECT_EQ(excerpt("\x1b[31mred\x1b[0m"), "\\x1b[31mred\\x1b[0m");
  EXPECT_EQ(excerpt("a\nb\tc\rd\x07\x7f"), "a\\nb\\tc\\x0dd\\x07\\x7f");
  EXPECT_EQ(excerpt("\xc2\x9b"
                    "31m"),
            "\\x9b31m");  // the control sequence introducer in one character
  EXPECT_EQ(excerpt("abc\u202e\u2066\u2028"), "abc\\u202e\\u2066\\u2028");
  EXPECT_EQ(excerpt(std::string_view("a\0b", 3)), "a\\x00b");
}

TEST(Shown, EscapesBytesThatAreNotUtf8) {
  for (const char* bad : {"\xff", "\xc3", "\x80"}) EXPECT_EQ(excerpt(bad).size(), 4u) << excerpt(bad);
  EXPECT_EQ(excerpt("\xc0\xaf"), "\\xc0\\xaf");
  EXPECT_EQ(excerpt("\xed\xa0\x80"), "\\xed\\xa0\\x80");
  EXPECT_EQ(excerpt("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");
}

TEST(Shown, CutsAtACharacterAndCountsTheDots) {
  EXPECT_EQ(excerpt("0123456789", 10), "0123456789");
  EXPECT_EQ(excerpt("0123456789a", 10), "0123456...");
  EXPECT_EQ(excerpt("01234ü89abc", 10), "01234ü...");
  EXPECT_EQ(excerpt("012345ü9abc", 10), "012345...");
  EXPECT_EQ(excerpt("01234\x1b\x1b\x1b", 10), "01234...");
  for (std::size_t size = 0; size < 300; ++size) EXPECT_LE(excerpt(std::string(size, '\x1b')).size(), kShown);
}

TEST(Printable, KeepsLinesAndEscapesTheRest) {
  EXPECT_EQ(printable("| hug |\n| \x1b[31m\xff |\t日本\r\n"), "| hug |\n| \\x1b[31m\\xff |\t日本\\x0d\n");
  EXPECT_EQ(printable(std::string(5000, 'x')), std::string(5000, 'x'));
}

TEST(CodePointAt, ReadsEachLengthAndRefusesShorterForms) {
  EXPECT_EQ(code_point_at("a", 0)->code, U'a');
  EXPECT_EQ(code_point_at("xü", 1)->code, U'ü');
  EXPECT_EQ(code_point_at("日", 0)->length, 3u);
  EXPECT_EQ(code_point_at("🤝", 0)->code, U'🤝');
  EXPECT_FALSE(code_point_at("\xe0\x80\x80", 0));
  EXPECT_FALSE(code_point_at("\xc3", 0));
}

TEST(Split, GivesOnePartMoreThanThereAreMarks) {
  EXPECT_THAT(split("a,b,c", ','), ElementsAre("a", "b", "c"));
  EXPECT_THAT(split("one", ','), ElementsAre("one"));
  EXPECT_THAT(split("a b:c", ':'), ElementsAre("a b", "c"));
}

TEST(Split, KeepsEmptyParts) {
  EXPECT_THAT(split("", ','), ElementsAre(""));
  EXPECT_THAT(split(",", ','), ElementsAre("", ""));
  EXPECT_THAT(split("a,,b,", ','), ElementsAre("a", "", "b", ""));
}

TEST(Trimmed, LosesBlanksAtBothEndsAndNoneBetween) {
  EXPECT_EQ(trimmed(" \t a b\t\r"), "a b");
  EXPECT_EQ(trimmed("a b"), "a b");
  EXPECT_EQ(trimmed("x"), "x");
}

TEST(Trimmed, IsEmptyWhereNothingElseIsThere) {
  EXPECT_EQ(trimmed(""), "");
  EXPECT_EQ(trimmed(" \r\t "), "");
}

TEST(Trimmed, LosesTheMarksAskedForAlone) {
  EXPECT_EQ(trimmed("\"a\"", "\""), "a");
  EXPECT_EQ(trimmed(" a\n"), "a\n") << "a line end is no blank of a line";
  EXPECT_EQ(trimmed("\ta \n", " \n"), "\ta");
}

TEST(Number, IsTheWholeText) {
  EXPECT_EQ(parse_number("0.25"), 0.25);
  EXPECT_EQ(parse_number("-3e2"), -300.0);
  for (const char* text : {"", " 1", "1 ", "1,5", "0.5m", "nan", "inf", "1e999", "+1", "one"})
    EXPECT_EQ(parse_number(text), std::nullopt) << text;
}

TEST(WithShortNames, CutsNamesInTheirMiddlesAndNothingElse) {
  const std::string sentence =
      "unknown task 'hugg': did you mean 'hug'? Known: hug, handshake and many more, it's said";
  EXPECT_EQ(with_short_names(sentence, 10), sentence);
  EXPECT_EQ(with_short_names("cannot read '" + std::string(50, 'a') + "z': no", 10), "cannot read 'aaaa...aaaz': no");
  EXPECT_EQ(with_short_names(std::string(50, 'a'), 10), "aaaaa...aaaaa");
  EXPECT_EQ(with_short_names("", 10), "");
}

TEST(WithShortNames, TakesAQuotedNameWithSpacesForOne) {
  std::string path;
  for (int i = 0; i < 100; ++i) path += "/my folder";
  const std::string told = with_short_names("cannot read '" + path + "': No such file; again '" + path + "'");
  EXPECT_LT(told.size(), 900U);
  EXPECT_TRUE(told.starts_with("cannot read '/my folder/my folder")) << told;
  EXPECT_NE(told.find("/my folder': No such file; again '/my"), std::string::npos) << told;
}

TEST(WithShortNames, CutsNoCharacterInTwo) {
  std::string name;
  for (int i = 0; i < 400; ++i) name += "ü";
  for (std::size_t most = 20; most < 24; ++most)
    EXPECT_EQ(excerpt(with_short_names(name, most)).find("\\x"), std::string::npos) << most;
}

}  // namespace
}  // namespace duet
