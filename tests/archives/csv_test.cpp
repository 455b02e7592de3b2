#include "duet/archives/csv.h"

#include <gtest/gtest.h>

#include <optional>

#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using Rows = std::vector<std::vector<std::string>>;

Rows rows_of(const std::string& text) {
  Rows rows;
  CsvReader reader(text, "x.csv");
  while (reader.next()) rows.emplace_back(reader.fields().begin(), reader.fields().end());
  return rows;
}

std::string refusal(const std::string& text) {
  return test::thrown_message<InputError>([&] { rows_of(text); });
}

TEST(Csv, EveryDialectGivesTheSameRows) {
  const Rows expected = {{"time", "hand"}, {"0.5", "1"}, {"1.5", "2"}};
  for (const char* text : {"time,hand\n0.5,1\n1.5,2\n", "\xef\xbb\xbftime,hand\n0.5,1\n1.5,2",
                           "time,hand\r\n0.5,1\r\n1.5,2\r\n", "time,hand\r0.5,1\r1.5,2\r", "time;hand\n0.5;1\n1.5;2\n",
                           "time\thand\n0.5\t1\n1.5\t2\n", "time hand\n0.5  1\n 1.5 2 \n",
                           "\"time\",\"hand\"\n\"0.5\",\"1\"\n1.5,\"2\"\n", "time,hand,,\n0.5,1,,\n1.5,2,\n",
                           "sep=;\ntime;hand\n0.5;1\n1.5;2\n", "# a comment\n\n time , hand\n\n0.5,\t1\n1.5, 2 \n\n"})
    EXPECT_EQ(rows_of(text), expected) << text;
}

TEST(Csv, ACommaIsAPointWhereItDividesNoFields) {
  for (const char* text : {"0,5;-1,25\n", "0,5\t-1,25\n", "a;b\n0,5;-1,25\n", "+0,5;-1,25\n"}) {
    CsvReader reader(text, "x.csv");
    while (reader.next()) {
    }
    EXPECT_EQ(reader.number(reader.fields()[0]), 0.5) << text;
    EXPECT_EQ(reader.number(reader.fields()[1]), -1.25) << text;
  }
  CsvReader commas("1,2\n", "x.csv");
  ASSERT_TRUE(commas.next());
  EXPECT_EQ(commas.number("0,5"), std::nullopt);
  CsvReader semicolons("1;2\n", "x.csv");
  ASSERT_TRUE(semicolons.next());
  for (const char* none : {"1.234,5", "1,234,5", ",", "", "nan", "x", "+-1"})
    EXPECT_EQ(semicolons.number(none), std::nullopt);
}

TEST(Csv, QuotesHoldDelimitersQuotesAndLineEnds) {
  EXPECT_EQ(rows_of("clip,note\na,\"one, \"\"two\"\"\nthree\"\nb,5\" wide\n"),
            (Rows{{"clip", "note"}, {"a", "one, \"two\"\nthree"}, {"b", "5\" wide"}}));
  CsvReader reader("a,b\n\"x\ny\",1\nc,d\n", "x.csv");
  for (int row = 0; row < 3; ++row) ASSERT_TRUE(reader.next());
  EXPECT_EQ(reader.line(), 4);
  EXPECT_SENTENCE(refusal("a,b\n1,\"2\n3,4\n"));
}

TEST(Csv, EmptyFieldsWithinTheColumnsStay) {
  EXPECT_EQ(rows_of("a,b,c\n1,,\n,,\n,2,3,,\n"), (Rows{{"a", "b", "c"}, {"1", "", ""}, {"", "", ""}, {"", "2", "3"}}));
  EXPECT_EQ(rows_of("a\tb\n\t1\n"), (Rows{{"a", "b"}, {"", "1"}}));
  EXPECT_EQ(rows_of("a,b\n1,2,3\n"), (Rows{{"a", "b"}, {"1", "2", "3"}}))
      << "what is too long is for the caller to say";
}

TEST(Csv, CommentsAreKeptAndLinesAreCountedInAllLineEnds) {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    const std::string text = "# rate: 30" + end + end + "a,b" + end + "1,2" + end;
    CsvReader reader(text, "x.csv");
    ASSERT_TRUE(reader.next());
    EXPECT_EQ(reader.line(), 3);
    EXPECT_EQ(reader.comments(), (std::vector<std::string_view>{"# rate: 30"}));
  }
}

TEST(Csv, TooManyFieldsAreRefusedBeforeTheyAreKept) { EXPECT_SENTENCE(refusal(std::string(1'000'000, ','))); }

TEST(Csv, AnotherHeaderIsRefusedWithBoth) {
  const auto header = [](const char* text) {
    return test::thrown_message<InputError>([&] {
      CsvReader reader(text, "x.csv");
      require_header(reader, std::vector<std::string>{"clip", "label"});
    });
  };
  EXPECT_SENTENCE(header("clip,name\n"));
  EXPECT_EQ(header("\xef\xbb\xbf\"clip\";label;;\n"), "(nothing was thrown)");
}

}  // namespace
}  // namespace duet
