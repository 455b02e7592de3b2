#include "duet/report/tables/analysis.h"

#include <gmock/gmock.h>

#include <cmath>

#include "duet/report/page/html_page.h"
#include "duet/report/page/run_analyses.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Pair;

TitledTable table(const std::string& title, const std::string& group = "") {
  return {.title = title,
          .caption = "Of <b>all</b>.",
          .table = {.header = {"Policy", "n"}, .rows = {{"d_star", "1.5 [1.0, 2.0]"}}},
          .notes = {"A note."},
          .group = group};
}

Analysis example() {
  Analysis analysis{.name = "two", .title = "Two tables", .tables = {table("First"), table("Second")}};
  EstimatesOf figures{{.engine = "mujoco", .policy = "say \"hi\", d_star"}, analysis.estimates};
  figures.rate("success", {.n = 3, .k = 1, .rate = 1.0 / 3.0, .interval = {.low = 0.1, .high = 0.75}});
  figures.add("dof_jerk", {}, std::nan(""), kNoInterval, "rad/s^3");
  figures.word("verdict", "better");
  return analysis;
}

TEST(Analysis, MarkdownHasAHeadingPerTable) {
  EXPECT_EQ(analysis_markdown(example()), R"(### First

Of &lt;b>all&lt;/b>.

| Policy |              n |
| :----- | -------------: |
| d_star | 1.5 [1.0, 2.0] |

A note.

### Second

Of &lt;b>all&lt;/b>.

| Policy |              n |
| :----- | -------------: |
| d_star | 1.5 [1.0, 2.0] |

A note.
)");
}

TEST(Analysis, NotesOfAllTablesStandUnderTheTitleAndTheTablesBelow) {
  Analysis noted = example();
  noted.warning = "Beware.";
  noted.notes = {"How to read them."};
  EXPECT_SENTENCE(analysis_markdown(noted));
  EXPECT_THAT(
      analysis_latex(noted),
      testing::StartsWith("% \\usepackage{booktabs, graphicx}\n% Beware.\n% How to read them.\n\n\\begin{table}\n"));
}

TEST(Analysis, WithoutTablesItIsItsNote) {
  const Analysis nothing{.name = "none", .title = "None", .notes = {"Nothing ran."}};
  EXPECT_TRUE(nothing.empty());
  EXPECT_EQ(analysis_markdown(nothing), "Nothing ran.\n");
  EXPECT_EQ(analysis_latex(nothing), "% Nothing ran.\n");
  EXPECT_EQ(analysis_json(nothing).at("figures").size(), 0U);
}

TEST(Analysis, ATerminalDoesWithoutLongTables) {
  Analysis analysis = example();
  analysis.tables[1].too_long_for_terminal = true;
  EXPECT_THAT(terminal_text(analysis), AllOf(HasSubstr("### First"), Not(HasSubstr("### Second"))));
  EXPECT_THAT(analysis_markdown(analysis), HasSubstr("### Second"));
}

TEST(Analysis, LatexIsATableThatFitsTheLinePerTableWithCaptionAndNotesAsText) {
  Analysis two = example();
  two.tables[0].notes = {"50 % of a_b."};
  EXPECT_THAT(analysis_latex(two), testing::StartsWith(R"(% \usepackage{booktabs, graphicx}

\begin{table}
\centering\small
\caption{First. Of <b>all</b>.}
\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%
\begin{tabular}{lr}
\toprule
Policy & n \\
\midrule
{}d\_star & 1.5 [1.0, 2.0] \\
\bottomrule
\end{tabular}
}
\par\smallskip\parbox{\linewidth}{\footnotesize 50 \% of a\_b.}
\end{table}

\begin{table}
\centering\small
\caption{Second. Of <b>all</b>.}
)"));
  two.tables.resize(1);
  two.tables[0].table.rows.clear();
  EXPECT_THAT(analysis_latex(two), HasSubstr("\n% First\n% Of <b>all</b>.\n% 50 % of a_b.\n"));
}

TEST(Analysis, ATableOfFewerColumnsKeepsItsLabels) {
  const TitledTable whole{.table = {.header = {"Policy", "n", "Success", "Lift"}, .rows = {{"a", "3", "1", "2"}}}};
  const TitledTable some = with_columns(whole, {"Lift", "n", "Speed"});
  EXPECT_THAT(some.table.header, ElementsAre("Policy", "n", "Lift"));
  EXPECT_THAT(some.table.rows, ElementsAre(ElementsAre("a", "3", "2")));
  EXPECT_EQ(with_columns(whole, {"Speed"}).table.header.size(), 4U) << "it has none of them";
}

TEST(Analysis, CsvIsAFigureALineNotRounded) {
  EXPECT_EQ(
      analysis_csv(example()),
      "analysis,source,engine,controller,policy,arm,perturbation,task,of,name,unit,n,k,value,low,high,level,text\r\n"
      "two,duet,mujoco,,\"say \"\"hi\"\", d_star\",,,,,success,1,3,1,0.3333333333333333,0.1,0.75,0.95,\r\n"
      "two,duet,mujoco,,\"say \"\"hi\"\", d_star\",,,,,dof_jerk,rad/s^3,,,,,,,\r\n"
      "two,duet,mujoco,,\"say \"\"hi\"\", d_star\",,,,,verdict,,,,,,,,better\r\n");
}

TEST(Analysis, JsonHasTheSameNamesAndEveryNoteOnce) {
  const nlohmann::json json = analysis_json(example());
  EXPECT_EQ(json.at("schema"), "duet.analysis/1");
  EXPECT_EQ(json.at("analysis"), "two");
  EXPECT_EQ(json.at("level"), 0.95);
  EXPECT_EQ(json.at("notes"), nlohmann::json::array({"A note."}));
  const nlohmann::json keys = {
      {"source", "duet"}, {"engine", "mujoco"}, {"policy", "say \"hi\", d_star"}, {"name", "success"}, {"unit", "1"}};
  nlohmann::json success = keys;
  success.update({{"n", 3}, {"k", 1}, {"value", 1.0 / 3.0}, {"low", 0.1}, {"high", 0.75}});
  EXPECT_EQ(json.at("figures").at(0), success);
  EXPECT_TRUE(json.at("figures").at(1).at("value").is_null());
  EXPECT_FALSE(json.at("figures").at(1).contains("low"));
  EXPECT_EQ(json.at("figures").at(2).at("text"), "better");
}

std::string html_of(const Analysis& analysis) {
  nlohmann::json drawn = nlohmann::json::array();
  return analysis_html(analysis, drawn);
}

TEST(Analysis, HtmlFoldsGroupsWhereThereAreSeveral) {
  Analysis analysis = example();
  analysis.warning = "Beware <all>.";
  EXPECT_THAT(html_of(analysis),
              AllOf(HasSubstr("<p class=\"warning\">Beware &lt;all&gt;.</p>"), HasSubstr("<h3>First</h3>"),
                    HasSubstr("<span class=\"rate\">1.5</span> <span class=\"ci\">[1.0, 2.0]</span>"),
                    Not(HasSubstr("<details"))));
  analysis.tables = {table("First", "a"), table("Second", "a"), table("Third", "b")};
  const std::string html = html_of(analysis);
  EXPECT_THAT(html, AllOf(HasSubstr("<details open><summary>a</summary><h3>First</h3>"),
                          HasSubstr("</details>\n<details><summary>b</summary><h3>Third</h3>")));
  analysis.tables.pop_back();
  EXPECT_THAT(html_of(analysis), Not(HasSubstr("<details")));
}

TEST(Analysis, PlotsWithATitleStandBelowTheTables) {
  const LinePlot plot{.title = "steps", .x_label = "x", .y_label = "y", .series = {{"s", {0.0, 1.0}, {0.0, 1.0}}}};
  Analysis analysis = example();
  analysis.plots = {{.plots = {plot}}, {.title = "Steps", .note = "One each.", .plots = {plot}}, {.title = "No plots"}};
  const std::string html = html_of(analysis);
  EXPECT_LT(html.find("<figure data-plot=\"0\"><figcaption>steps<"), html.find("<h3>First"));
  EXPECT_GT(html.find("<figure data-plot=\"1\">"), html.find("<h3>Steps"));
  EXPECT_GT(html.find("<h3>Steps</h3><p>One each.</p>"), html.find("<h3>Second"));
  EXPECT_THAT(html, Not(HasSubstr("No plots")));
}

TEST(Analysis, EachFormatIsAFileOfItsName) {
  const std::vector<Analysis> analyses = {example(), {.name = "bare", .title = ""}};
  for (const char* format : {"md", "csv", "tex", "json"})
    EXPECT_EQ(analysis_files(analyses, format).at(0).first, std::string("two.") + format);
  EXPECT_EQ(analysis_files(analyses, "csv").at(0).second, analysis_csv(example()));
  EXPECT_THAT(analysis_files(analyses, "tex"), ElementsAre(Pair("two.tex", testing::_)));  // an empty file is none
  EXPECT_THAT(analysis_files(analyses, "html"), IsEmpty());
}

TEST(Analysis, EachIsAMemberOfItsName) {
  nlohmann::json found = {{"files", 3}};
  add_analyses({example()}, found);
  EXPECT_EQ(found, (nlohmann::json{{"files", 3}, {"two", analysis_json(example())}}));
}

// The list of analyses: what of it a run has, what a terminal shows.

RunTables tables_of(std::vector<EpisodeRow> rows) { return run_tables(std::move(rows), {}, nullptr); }

std::vector<std::string> names_of(const std::vector<Analysis>& analyses) {
  std::vector<std::string> names;
  for (const Analysis& analysis : analyses) names.push_back(analysis.name);
  return names;
}

std::vector<EpisodeRow> two_engines() {
  std::vector<EpisodeRow> rows;
  for (const char* engine : {"mujoco", "ode"})
    for (const char* perturbation : {"clean", "jitter_1cm"})
      add_episodes({.engine = engine, .policy = "dstar", .perturbation = perturbation, .successes = "1101"}, rows);
  for (EpisodeRow& row : rows) row.metrics = {{"hf_ratio", 0.25}};
  return rows;
}

TEST(RunAnalyses, AreThoseThatTheRowsHaveFiguresOf) {
  EXPECT_THAT(names_of(run_analyses(tables_of(two_engines()))),
              ElementsAre("board", "leaderboard", "engines", "controllers", "policies", "degradation"));
  EXPECT_THAT(names_of(run_analyses(tables_of(two_engines()), Extent::kRun)),
              ElementsAre("board", "leaderboard", "engines", "controllers"));
}

TEST(RunAnalyses, ARunWithoutEpisodesSaysSo) {
  const RunTables nothing = tables_of({});
  const std::vector<Analysis> analyses = run_analyses(nothing);
  EXPECT_THAT(names_of(analyses), ElementsAre("leaderboard"));
  EXPECT_EQ(run_text(analyses), "No episodes.\n");
  EXPECT_EQ(run_screen(nothing, analyses, {"a note"}), "> a note\n\nNo episodes.\n");
}

TEST(RunAnalyses, ATerminalBeginsWithTheBoard) {
  const RunTables tables = tables_of(two_engines());
  const std::string text = run_text(run_analyses(tables));
  EXPECT_THAT(text, testing::StartsWith("### Board\n\nvmc with dstar"));
  EXPECT_LT(text.find("By engine"), text.find("### Success per engine"));
  EXPECT_LT(text.find("### Success per engine"), text.find("### Controllers"));
  EXPECT_THAT(text, Not(HasSubstr("Mean over the episodes that have the metric")));  // of several engines
}

TEST(RunAnalyses, RobotsThatWalkByCommandAreJudgedByNoAct) {
  std::vector<EpisodeRow> rows = two_engines();
  for (EpisodeRow& row : rows) row.task = "walk";
  const RunTables tables = tables_of(rows);
  const std::vector<Analysis> analyses = run_analyses(tables);
  EXPECT_THAT(names_of(analyses), ElementsAre("leaderboard", "engines", "controllers", "walking"));
  const std::string text = run_text(analyses);
  EXPECT_EQ(run_screen(tables, analyses, {}), text);
  EXPECT_THAT(text, AllOf(testing::StartsWith("### Walking by command"), Not(HasSubstr("### Success per engine"))));
}

TEST(RunAnalyses, EachIsFoundByItsName) {
  const RunTables tables = tables_of(two_engines());
  for (const Analysis& analysis : run_analyses(tables))
    EXPECT_EQ(run_analysis(tables, analysis.name).name, analysis.name);
  EXPECT_TRUE(run_analysis(tables, "contacts").empty());
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { run_analysis(tables, "contact"); }),
              HasSubstr("unknown table 'contact': did you mean 'contacts'?"));
}

}  // namespace
}  // namespace duet
