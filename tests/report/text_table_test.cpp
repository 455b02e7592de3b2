#include "duet/report/tables/text_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "duet/core/require.h"
#include "duet/report/page/training_curves.h"
#include "duet/report/tables/line_plot.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

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

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

LinePlot two_feet() {
  return {.title = "feet",
          .x_label = "time [s]",
          .y_label = "height [m]",
          .series = {{"left", {0.0, 1.0, 2.0}, {0.0, 0.1, 0.0}}, {"right", {0.0, 1.0, 2.0}, {0.1, 0.0, 0.1}}}};
}

TEST(LinePlot, IsWhatTheViewerDraws) {
  const nlohmann::json json = plot_json(two_feet());
  EXPECT_EQ(json.at("x_label"), "time [s]");
  EXPECT_EQ(json.at("loss"), false);
  EXPECT_EQ(json.at("series").at(0),
            (nlohmann::json{{"name", "left"}, {"x", {0.0, 1.0, 2.0}}, {"y", {0.0, 0.1, 0.0}}}));
  EXPECT_EQ(json.at("series").at(1), (nlohmann::json{{"name", "right"}, {"y", {0.1, 0.0, 0.1}}}));  // over the same x
}

TEST(LinePlot, PointsThatAreNotFiniteInterruptTheLine) {
  LinePlot plot = two_feet();
  plot.series = {{"left", {0.0, 1.0, 2.0, 3.0}, {0.0, kNan, 1.0, HUGE_VAL}}};
  EXPECT_EQ(plot_json(plot).at("series").at(0).at("y").dump(), "[0.0,null,1.0,null]");
}

TEST(LinePlot, NothingToDrawIsNothing) {
  EXPECT_TRUE(plot_json({}).is_null());
  LinePlot plot = two_feet();
  plot.series[0].x = {kNan, 1.0, kNan};
  plot.series[0].y = {0.0, kNan, 0.0};
  EXPECT_EQ(plot_json(plot).at("series").size(), 1U);
  EXPECT_TRUE(plot_json(plot).at("series").at(0).contains("x"));
  plot.series.pop_back();
  EXPECT_TRUE(plot_json(plot).is_null());
}

TEST(LinePlot, LongSeriesAreThinnedAndKeepTheirEnds) {
  LineSeries series{"a", {}, {}};
  for (int i = 0; i <= 10000; ++i) series.x.push_back(i), series.y.push_back(i / 7.0);
  LinePlot plot{.title = "x", .x_label = "", .y_label = "", .series = {series}};
  const nlohmann::json json = plot_json(plot).at("series").at(0);
  EXPECT_EQ(json.at("x").size(), kPlotPoints);
  EXPECT_EQ(json.at("x").front(), 0.0);
  EXPECT_EQ(json.at("x").back(), 10000.0);
  EXPECT_EQ(json.at("y").back().dump(), "1428.6");
  plot.loss = true;
  EXPECT_LT(plot_json(plot).dump().size(), 3000U);  // a report has one for each clip
}

TEST(LinePlot, LengthsThatDifferAreRefused) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] {
    plot_json({.title = "x", .x_label = "", .y_label = "", .series = {{"a", {1.0, 2.0}, {1.0}}}});
  }));
}

TEST(TrainingCurves, ColumnsByHeaderAgainstTheFirst) {
  const TrainingCurves curves = parse_curves("steps, return,falls\r\n0,1.5,nan\n1000,2.5,\n\n2000,3,0.25\n", "c.csv");
  EXPECT_EQ(curves.columns, (std::vector<std::string>{"steps", "return", "falls"}));
  EXPECT_EQ(curves.values[1], (std::vector<double>{1.5, 2.5, 3.0}));
  EXPECT_TRUE(std::isnan(curves.values[2][0]) && std::isnan(curves.values[2][1]));
  const std::vector<LinePlot> plots = curve_plots(curves);
  ASSERT_EQ(plots.size(), 2U);
  EXPECT_EQ(plots[0].x_label, "steps");
  EXPECT_EQ(plots[1].y_label, "falls");
  EXPECT_EQ(plot_json(plots[1]).at("series").at(0).at("y").dump(), "[null,null,0.25]");
}

TEST(TrainingCurves, TablesOfSpreadsheetsGiveTheSame) {
  const TrainingCurves curves = parse_curves("steps,return\n0,1.5\n10,2.5\n", "c.csv");
  for (const char* text :
       {"\xef\xbb\xbfsteps;return\r\n0;1,5\r\n10;2,5\r\n", "\"steps\",\"return\",\r0,1.5,\r10,2.5,\r"})
    EXPECT_EQ(parse_curves(text, "c.csv").values, curves.values) << text;
}

TEST(TrainingCurves, LevelColumnsAndASecondClockAreNotDrawn) {
  const std::vector<LinePlot> plots =
      curve_plots(parse_curves("steps,minutes,return,loss\n0,0.1,1,0\n10,0.2,2,0\n", "c.csv"));
  ASSERT_EQ(plots.size(), 1U);
  EXPECT_EQ(plots[0].y_label, "return");
}

TEST(TrainingCurves, BadInputIsNamedByFileLineAndColumn) {
  const auto refusal = [](const char* csv) { return thrown_message<InputError>([&] { parse_curves(csv, "c.csv"); }); };
  for (const char* text :
       {"steps,return\n1,x\n", "steps,return\n1\n", "steps\n1\n", "steps,,falls\n1,2,3\n", "a,a\n1,2\n", "", "a,b\n"})
    EXPECT_SENTENCE(refusal(text));
  EXPECT_SENTENCE(thrown_message<InputError>([] { load_curves("nowhere.csv"); }));
}

}  // namespace
}  // namespace duet
