#include <gtest/gtest.h>

#include "duet/core/require.h"

namespace duet {
namespace {

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

}  // namespace
}  // namespace duet
