#include <gtest/gtest.h>

#include <cmath>

#include "duet/report/tables/text_table.h"

namespace duet {
namespace {

TEST(Cells, ANumberThatIsNotFiniteIsADash) {
  const double nan = std::nan("");
  for (const std::string& cell : {decimals(nan, 2), percent(nan), points(nan), significant(nan), short_number(nan),
                                  percent(nan, {.low = 0.0, .high = 1.0})})
    EXPECT_EQ(cell, "-");
}

TEST(Cells, WithoutAnIntervalANumberStandsAlone) {
  EXPECT_EQ(percent(0.849, {.low = 0.776, .high = 0.901}), "84.9 [77.6, 90.1]");
  EXPECT_EQ(percent(0.849, kNoInterval), "84.9");
  EXPECT_EQ(points(0.123, {.low = 0.045, .high = 0.201}), "+12.3 [4.5, 20.1]");
  EXPECT_EQ(points(-0.047), "-4.7");
  EXPECT_EQ(decimals(0.5, kNoInterval, 2), "0.50");
  EXPECT_EQ(short_number(13.84, {.low = 9.876, .high = 100.4}), "13.8 [9.88, 100]");
}

// A spreadsheet computes a cell that begins with one of four signs; a number is none of these.
TEST(CsvTable, HasNoFormula) {
  const TextTable table = {.header = {"name", "value"},
                           .rows = {{"=1+2", "-4.5"}, {"-2+3", "+1.5e-3"}, {"@SUM(A1)", "-"}, {"+a,b", "1"}}};
  EXPECT_EQ(csv_table(table), "name,value\r\n'=1+2,-4.5\r\n'-2+3,+1.5e-3\r\n'@SUM(A1),-\r\n\"'+a,b\",1\r\n");
}

TEST(Cells, NothingIsMinusZero) {
  EXPECT_EQ(percent(-0.0), "0.0");
  EXPECT_EQ(points(-0.00001), "+0.0");
  EXPECT_EQ(decimals(-0.0, 3), "0.000");
}

TEST(Cells, AShortNumberHasThreeDigitsAsFarAsTheyAreDecimals) {
  EXPECT_EQ(short_number(0.1624), "0.162");
  EXPECT_EQ(short_number(0.1624, 2), "0.16");
  EXPECT_EQ(short_number(1.624), "1.62");
  EXPECT_EQ(short_number(16.24), "16.2");
  EXPECT_EQ(short_number(1624.4), "1624");
  EXPECT_EQ(short_number(123456.0), "1.23e+05");
}

TEST(Cells, ATaskIsAWord) {
  EXPECT_EQ(task_title("high_five"), "High-five");
  EXPECT_EQ(task_title("all"), "Overall");
}

}  // namespace
}  // namespace duet
