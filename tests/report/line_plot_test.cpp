#include "duet/report/tables/line_plot.h"

#include <gmock/gmock.h>

#include <limits>

#include "duet/core/require.h"
#include "duet/report/page/training_curves.h"
#include "duet/report/tables/axis.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

int count_of(const std::string& text, const std::string& part) {
  int count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

LinePlot two_feet() {
  return {.title = "feet",
          .x_label = "time [s]",
          .y_label = "height [m]",
          .series = {{"left", {0.0, 1.0, 2.0}, {0.0, 0.1, 0.0}}, {"right", {0.0, 1.0, 2.0}, {0.1, 0.0, 0.1}}}};
}

TEST(LinePlot, NamesAxesSeriesAndColours) {
  const std::string svg = line_plot_svg(two_feet());
  EXPECT_THAT(svg, AllOf(HasSubstr("time [s]"), HasSubstr("height [m]"), HasSubstr(">left<"), HasSubstr(">right<")));
  EXPECT_THAT(svg, AllOf(HasSubstr("var(--t0)"), HasSubstr("var(--t1)"), HasSubstr("class=\"plot\"")));
}

TEST(LinePlot, OneSeriesHasNoLegend) {
  LinePlot plot = two_feet();
  plot.series.pop_back();
  EXPECT_THAT(line_plot_svg(plot), Not(HasSubstr("class=\"key\"")));
}

TEST(LinePlot, PointsThatAreNotFiniteInterruptTheLine) {
  LinePlot plot = two_feet();
  plot.series = {{"left", {0.0, 1.0, 2.0, 3.0}, {0.0, kNan, 1.0, 2.0}}};
  const std::string svg = line_plot_svg(plot);
  EXPECT_EQ(count_of(svg.substr(svg.find(" d=\"")), "M"), 2);
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(LinePlot, NothingToDrawIsNothing) {
  EXPECT_EQ(line_plot_svg({}), "");
  EXPECT_EQ(line_plot_svg({.title = "x", .x_label = "", .y_label = "", .series = {{"a", {kNan}, {1.0}}}}), "");
}

TEST(LinePlot, LevelAndSingleValuesHaveAnAxis) {
  for (const double value : {0.0, 1e-9, -3.0, 5e7}) {
    const std::string svg =
        line_plot_svg({.title = "x", .x_label = "", .y_label = "", .series = {{"a", {1.0, 1.0}, {value, value}}}});
    EXPECT_THAT(svg, AllOf(HasSubstr("<svg"), Not(HasSubstr("nan")), Not(HasSubstr("inf")))) << value;
  }
}

TEST(LinePlot, LongSeriesAreThinnedAndKeepTheirEnds) {
  LineSeries series{"a", {}, {}};
  for (int i = 0; i <= 10000; ++i) series.x.push_back(i), series.y.push_back(i % 7);
  const std::string svg = line_plot_svg({.title = "x", .x_label = "", .y_label = "", .series = {series}});
  EXPECT_LT(svg.size(), 20000U);
  EXPECT_THAT(svg, HasSubstr("L584.0 "));  // the last point is at the right end
}

TEST(LinePlot, NamesAreEscaped) {
  LinePlot plot = two_feet();
  plot.series[0].name = "<b>";
  EXPECT_THAT(line_plot_svg(plot), AllOf(HasSubstr("&lt;b&gt;"), Not(HasSubstr("<b>"))));
}

TEST(LinePlot, LengthsThatDifferAreRefused) {
  EXPECT_THAT(thrown_message<std::invalid_argument>([] {
                line_plot_svg({.title = "x", .x_label = "", .y_label = "", .series = {{"a", {1.0, 2.0}, {1.0}}}});
              }),
              HasSubstr("series 'a' has 2 x but 1 y"));
}

TEST(PlotAxis, StepsAreOneTwoFive) {
  EXPECT_DOUBLE_EQ(nice_step(10.0, 5), 2.0);
  EXPECT_DOUBLE_EQ(nice_step(0.3, 3), 0.1);
  EXPECT_DOUBLE_EQ(nice_step(31.0, 10), 5.0);
}

TEST(PlotAxis, TicksAreRoundValuesWithinIt) {
  PlotAxis axis{.from = 0.0, .to = 100.0};
  EXPECT_TRUE(axis.empty());
  axis.take(0.3);
  axis.take(9.7);
  axis.round(5);
  EXPECT_THAT(axis.ticks(), testing::ElementsAre(0.0, 2.0, 4.0, 6.0, 8.0, 10.0));
  EXPECT_EQ(axis.at(5.0), 50.0);
  EXPECT_EQ(axis.label(2.0), "2");
  EXPECT_EQ(axis.label(12000.0), "12k");
}

TEST(PlotAxis, DecadesAreWhole) {
  PlotAxis axis{.from = 100.0, .to = 0.0, .logarithmic = true};
  axis.take(3e-5);
  axis.take(0.2);
  axis.round_decades(20);
  EXPECT_EQ(axis.ticks().size(), 6U);  // 1e-5 to 1
  EXPECT_DOUBLE_EQ(axis.at(1.0), 0.0);
  EXPECT_DOUBLE_EQ(axis.at(1e-5), 100.0);
  EXPECT_EQ(axis.label(axis.ticks().front()), "1e-5");
  EXPECT_EQ(axis.label(axis.ticks().back()), "1");
  axis.round_decades(3);
  EXPECT_EQ(axis.ticks().size(), 3U);
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
  EXPECT_THAT(line_plot_svg(plots[1]), HasSubstr("<svg"));
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
  EXPECT_EQ(refusal("steps,return\n1,x\n"), "'c.csv': line 2: column 'return': expected a number, found 'x'");
  EXPECT_EQ(refusal("steps,return\n1\n"), "'c.csv': line 2: expected 2 cells, found 1");
  EXPECT_EQ(refusal("steps\n1\n"), "'c.csv': line 1: expected two or more columns, found 1");
  EXPECT_EQ(refusal("steps,,falls\n1,2,3\n"), "'c.csv': line 1: column 2 has no name");
  EXPECT_EQ(refusal("a,a\n1,2\n"), "'c.csv': line 1: column 'a' is there twice");
  EXPECT_THAT(refusal(""), HasSubstr("found none"));
  EXPECT_THAT(refusal("a,b\n"), HasSubstr("found none"));
  EXPECT_THAT(thrown_message<InputError>([] { load_curves("nowhere.csv"); }), HasSubstr("nowhere.csv"));
}

}  // namespace
}  // namespace duet
