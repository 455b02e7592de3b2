#include "duet/report/page/html_report.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <regex>

#include "duet/report/page/key_frames.h"
#include "duet/report/page/run_analyses.h"
#include "duet/report/page/training_curves.h"
#include "duet/report/tables/line_plot.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// A person of a few bones who stands at (x, y).
StickFigure person(const std::string& label, double x, double y) {
  StickFigure figure{.label = label, .points = {}, .bones = {{0, 1}, {1, 2}, {0, 3}, {0, 4}, {1, 5}, {1, 6}}};
  figure.points = {{x, y, 0.9},       {x, y, 1.4},       {x, y, 1.6},      {x, y - 0.1, 0.0},
                   {x, y + 0.1, 0.0}, {x, y - 0.3, 1.1}, {x, y + 0.3, 1.1}};
  return figure;
}

std::vector<KeyFrame> meeting() {
  return {{"start 0.00 s", {person("source", 1.6, 0.0), person("human", 0.0, 0.0), person("robot", 1.5, 0.0)}},
          {"act 1.00 s", {person("source", 1.1, 0.0), person("human", 0.5, 0.0), person("robot", 1.0, 0.0)}}};
}

Analysis entries_of(const std::vector<EpisodeRow>& rows) { return leaderboard_analysis(leaderboard(rows), {}); }

// Without a viewer: plain tables.
std::string html_of(const ReportContent& content) { return html_report(content, {}); }

nlohmann::json data_of(const std::string& html) {
  const std::string begin = "id=\"duet-report\">";
  const std::size_t at = html.find(begin) + begin.size();
  return nlohmann::json::parse(html.substr(at, html.find("</script>", at) - at));
}

ReportContent content() {
  ReportContent content;
  content.title = "Tiny <run> & \"more\"";
  content.environment = {{"machine", "A processor, 2 cores"},
                         {"build", {{"version", "0.1.0"}, {"commit", "abcdef0123456789"}}}};
  content.notes = {"<script>alert('x')</script>"};
  content.analyses = {entries_of({episode("replay", "hug", 0, true), episode("null", "hug", 0, false, "null")})};
  content.columns = {{"jpe", "Joint position error", "m", "lower"}, {"contact_f1", "Contact F1", "1", "higher"}};
  content.retargeting = {{"all", {{"jpe", 0.0625}}}, {"hug", {{"jpe", 0.125}, {"contact_f1", 0.5}, {"unlisted", 7.0}}}};
  content.stories = {{"clip <1>", "hug", meeting(), {{"total", {10.0, 1.0, 0.1}}}, {{"jpe", 0.03}}},
                     {"clip 2", "wave", {}, {}, {}}};
  return content;
}

// Every tag that opens is closed, in order: enough of a parser for what this report is made of.
std::string unbalanced_tag(const std::string& html) {
  static const std::regex tag(R"(<(/?)([a-zA-Z0-9]+)[^>]*?(/?)>)");
  std::vector<std::string> open;
  std::string text = html.substr(html.find("<html"));
  text.erase(text.find("<style>"), text.find("</style>") - text.find("<style>"));
  text.erase(text.find("<script "), text.rfind("</script>") - text.find("<script "));
  for (auto it = std::sregex_iterator(text.begin(), text.end(), tag); it != std::sregex_iterator(); ++it) {
    const std::string name = (*it)[2];
    if (name == "meta" || name == "img" || (*it)[3] == "/" || name == "style" || name == "script") continue;
    if ((*it)[1] != "/") {
      open.push_back(name);
    } else if (open.empty() || open.back() != name) {
      return name;
    } else {
      open.pop_back();
    }
  }
  return open.empty() ? "" : open.back();
}

TEST(HtmlReport, IsOneFileThatNeedsNoNetwork) {
  const std::string html = html_report(content(), {"/* a script */", "/* a style */"});
  EXPECT_THAT(html, testing::StartsWith("<!DOCTYPE html>"));
  EXPECT_EQ(unbalanced_tag(html), "");
  for (const char* outside : {"http:", "https:", "src=", "@import", "url(", "<link"})
    EXPECT_THAT(html, Not(HasSubstr(outside)));
  EXPECT_THAT(html, AllOf(HasSubstr("<style>/* a style */</style>"), HasSubstr("<script>/* a script */</script>"),
                          HasSubstr("lang=\"en\""), HasSubstr("<noscript>")));
}

TEST(HtmlReport, EscapesEveryText) {
  ReportContent hostile = content();
  const std::string evil = "\"><script>x</script>&'";
  std::vector<EpisodeRow> rows = {episode(evil, "hug", 0, true)};
  rows[0].engine = evil;
  hostile.analyses = {entries_of(rows)};
  hostile.replays = {{.file = evil, .scene = evil, .name = evil, .keys = {evil}}};
  hostile.columns[0].title = hostile.columns[0].unit = evil;
  hostile.retargeting[evil] = {{evil, 1.0}};
  hostile.stories[0].title = hostile.stories[0].task = evil;
  hostile.stories[0].frames[0].label = hostile.stories[0].frames[0].figures[0].label = evil;
  hostile.stories[0].loss[evil] = {1.0};
  hostile.stories[0].metrics[evil] = 1.0;
  hostile.environment[evil] = evil;
  const std::string html = html_of(hostile);
  EXPECT_THAT(html, AllOf(Not(HasSubstr("<script>x")), Not(HasSubstr("<script>alert")),
                          HasSubstr("Tiny &lt;run&gt; &amp; &quot;more&quot;")));
  EXPECT_EQ(unbalanced_tag(html), "");
  EXPECT_EQ(data_of(html).at("replays").begin().value(), evil);
  EXPECT_EQ(escape_html("<a b=\"c\">&'"), "&lt;a b=&quot;c&quot;&gt;&amp;&#39;");
  EXPECT_EQ(escape_html("clip \x1b[31m7"), "clip \\x1b[31m7");
}

TEST(HtmlReport, ShowsMachineNotesTablesAndClips) {
  const std::string html = html_of(content());
  for (const char* piece : {"A processor, 2 cores · duet 0.1.0 (abcdef0123)", "id=\"leaderboard\"",
                            "id=\"retargeting\"", "id=\"clips\"", "<details><summary>", "Joint position error",
                            "0.0625", "unlisted", "start 0.00 s", "data-task=\"wave\"", "null (control)"}) {
    EXPECT_THAT(html, HasSubstr(piece));
  }
}

std::vector<EpisodeRow> two_engines() {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 6; ++i) {
    for (const char* engine : {"mujoco", "ode", "playback"}) {
      rows.push_back(test::engine_episode(engine, "replay", i, i < 4));
      rows.back().metrics = {{"jpe", 0.125}};
      rows.back().forces = {{"human.peak_n", 80.0}};
    }
  }
  return rows;
}

TEST(HtmlReport, HoldsTheDataOfWhatTheViewerDraws) {
  ReportContent shown = content();
  const RunTables tables = run_tables(two_engines(), {}, nullptr);
  shown.analyses = run_analyses(tables);
  shown.replays = {{.file = "replay.html", .scene = "s", .name = "n", .keys = {"0123456789abcdef0123"}}};
  const nlohmann::json data = data_of(html_of(shown));
  EXPECT_EQ(data.at("schema"), "duet.report/1");
  // The figures are those of the JSON files, so far as they are drawn.
  const nlohmann::json whole = analysis_json(run_analysis(tables, "leaderboard")).at("figures");
  for (const nlohmann::json& figure : data.at("leaderboard").at("figures"))
    EXPECT_THAT(whole, testing::Contains(figure)) << figure.dump();
  const auto named = [&](const char* analysis, const char* name) {
    return std::ranges::count_if(data.at(analysis).at("figures"), [&](const auto& f) { return f.at("name") == name; });
  };
  EXPECT_EQ(named("board", "mean_success"), 1);
  EXPECT_EQ(named("leaderboard", "success"), 6);  // three engines, a task and all
  EXPECT_EQ(named("leaderboard", "jpe"), 0);
  EXPECT_EQ(data.at("tasks").at(0), (nlohmann::json{{"name", "hug"}, {"title", "Hug"}}));
  EXPECT_EQ(data.at("metrics").at("jpe").at("direction"), "lower");
  EXPECT_EQ(data.at("replays"), (nlohmann::json{{"0123456789abcdef", "replay.html"}}));
  const nlohmann::json& loss = data.at("plots").at(0);
  EXPECT_EQ(loss.at("loss"), true);
  EXPECT_EQ(loss.at("series").at(0), (nlohmann::json{{"name", "total"}, {"x", {0, 1, 2}}, {"y", {10.0, 1.0, 0.1}}}));
}

TEST(HtmlReport, TheVerdictComesFirst) {
  ReportContent shown = content();
  shown.analyses = run_analyses(run_tables(two_engines(), {}, nullptr));
  const std::string html = html_of(shown);
  EXPECT_LT(html.find("<div class=\"answer\"><p class=\"first\">"), html.find("id=\"board\""));
  EXPECT_LT(html.find("id=\"board\""), html.find("id=\"leaderboard\""));
}

TEST(HtmlReport, HasASectionAcrossEngines) {
  ReportContent across = content();
  const std::string evil = "\"><script>x</script>&'";
  std::vector<EpisodeRow> rows = two_engines();
  for (EpisodeRow& row : rows) {
    if (row.engine == "ode") row.engine = evil;
  }
  RunTables tables = run_tables(rows, {.all = {}, .drifting = across.columns}, nullptr);
  across.analyses = {run_analysis(tables, "engines")};
  std::string html = html_of(across);
  EXPECT_EQ(unbalanced_tag(html), "");
  EXPECT_THAT(html, AllOf(HasSubstr("id=\"engines\""), HasSubstr("Across engines"),
                          HasSubstr("src=\"data:image/svg+xml;base64,"), HasSubstr("Success per engine"),
                          HasSubstr("Time until engines part"),
                          HasSubstr("No parity certificate is attached (duet validate makes one)."),
                          Not(HasSubstr("<script>x")), Not(HasSubstr("http:"))));
  tables.certificate = {{"schema", "duet.certificate/1"}, {"engines", {{{"name", evil}, {"passed", 20}}}}};
  across.analyses = {run_analysis(tables, "engines")};
  html = html_of(across);
  EXPECT_EQ(unbalanced_tag(html), "");
  EXPECT_THAT(html,
              AllOf(HasSubstr("Parity certificate"), HasSubstr("<td>20</td>"), Not(HasSubstr("<script>x")),
                    HasSubstr("The certificate does not cover mujoco."), Not(HasSubstr("No parity certificate"))));
}

TEST(HtmlReport, ShowsContactWithPeopleOnlyWhereThereIsASolidPartner) {
  ReportContent solid = content();
  EXPECT_THAT(html_of(solid), Not(HasSubstr("Contact with people")));
  std::vector<EpisodeRow> rows = two_engines();
  solid.analyses = {contact_analysis(rows)};
  EXPECT_THAT(html_of(solid), Not(HasSubstr("<details open>")));
  const std::string evil = "\"><script>x</script>&'";
  for (EpisodeRow& row : rows) {
    row.forces["human." + evil + ".peak_n"] = 150.0;
    row.forces["human." + evil + ".worst_ratio"] = 1.5;
    if (row.engine == "ode") row.engine = row.policy = evil;
  }
  solid.analyses = {contact_analysis(rows)};
  const std::string html = html_of(solid);
  EXPECT_EQ(unbalanced_tag(html), "");
  EXPECT_THAT(html, AllOf(HasSubstr("id=\"contacts\""), HasSubstr("class=\"warning\">Limits: unverified"),
                          HasSubstr("<td class=\"over\">150 (1.50*)</td>"), HasSubstr("<details open>"),
                          Not(HasSubstr("<script>x"))));
}

TEST(HtmlReport, EmptyContentHasNoEmptySections) {
  const std::string html = html_of({});
  EXPECT_EQ(unbalanced_tag(html), "");
  EXPECT_THAT(html, Not(HasSubstr("<section")));
}

TEST(HtmlReport, NeverPrintsNan) {
  ReportContent broken = content();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  broken.stories[0].frames[0].figures[1].points[2].x() = nan;
  broken.stories[0].loss["bad"] = {nan, std::numeric_limits<double>::infinity()};
  broken.stories[0].loss["holes"] = {1.0, nan, 0.5};
  broken.retargeting["hug"]["jpe"] = nan;
  broken.stories[0].metrics["jpe"] = nan;
  const std::string html = html_of(broken);
  EXPECT_FALSE(std::regex_search(html.substr(html.find("<body>")), std::regex(R"([^a-z](nan|inf)[^a-z])")));
  EXPECT_EQ(data_of(html).at("plots").at(0).at("series").size(), 2U);  // a term without a value is left out
}

TEST(KeyFrames, AreSeenAcrossTheLineBetweenTheAgents) {
  // Wherever the two stand, the drawing is that of two people 1.5 m apart along the paper.
  const std::string along_x = key_frames_svg(meeting());
  std::vector<KeyFrame> turned = meeting();
  for (KeyFrame& frame : turned) {
    for (StickFigure& figure : frame.figures) {
      for (Eigen::Vector3d& p : figure.points) p = {4.0 - p.y(), -7.0 + p.x(), p.z()};
    }
  }
  const auto without_ticks = [](const std::string& svg) {
    return std::regex_replace(svg, std::regex(R"(<path class="ground" stroke-width="8"[^>]*>)"), "");
  };
  EXPECT_EQ(without_ticks(key_frames_svg(turned)), without_ticks(along_x));
  EXPECT_THAT(along_x, AllOf(HasSubstr("class=\"human\""), HasSubstr("class=\"robot\""), HasSubstr("class=\"source\""),
                             HasSubstr("far"), HasSubstr("<circle class=\"human\"")));
}

TEST(KeyFrames, CoordinatesAreWholeMillimetres) {
  EXPECT_FALSE(std::regex_search(key_frames_svg(meeting()), std::regex(R"([ML][0-9]*\.[0-9])")));
}

TEST(KeyFrames, OddInputIsDrawnAsFarAsItGoes) {
  EXPECT_EQ(key_frames_svg({}), "");
  EXPECT_EQ(key_frames_svg({{"empty", {}}}), "");
  // One agent only, agents in one place, bones to points that are not there.
  EXPECT_NE(key_frames_svg({{"alone", {person("human", 0, 0)}}}), "");
  EXPECT_NE(key_frames_svg({{"same", {person("human", 0, 0), person("robot", 0, 0)}}}), "");
  StickFigure loose = person("other", 0, 0);
  loose.bones = {{0, 99}, {-1, 0}, {0, 1}};
  EXPECT_THAT(key_frames_svg({{"loose", {loose}}}), HasSubstr("class=\"other"));
}

EpisodeRow walking(const std::string& controller, int number, Outcome outcome) {
  EpisodeRow row = test::engine_episode("mujoco", "replay", number, true, controller);
  row.outcome = outcome;
  row.metrics = {{"hf_ratio", 0.25}};
  row.feet = {.rate_hz = 25.0, .left_mm = {0, 60, 0}, .right_mm = {50, 0, 40}};
  return row;
}

TEST(HtmlReport, TrainingStandsBelowTheResults) {
  ReportContent shown = content();
  shown.curves = {parse_curves("steps,return\n0,1\n10,2\n", "curves.csv")};
  const std::string html = html_of(shown);
  EXPECT_GT(html.find("id=\"training\""), html.find("id=\"clips\""));
}

TEST(HtmlReport, ShowsControllersStepsAndTraining) {
  const std::vector<EpisodeRow> rows = {walking("wbc_sim", 0, Outcome::kOk)};
  ReportContent shown = content();
  shown.analyses = run_analyses(run_tables(rows, {}, nullptr));
  shown.curves = {parse_curves("steps,return\n0,1\n10,2\n", "<curves>.csv")};
  const std::string html = html_of(shown);
  EXPECT_EQ(unbalanced_tag(html), "");
  EXPECT_THAT(
      html, AllOf(HasSubstr("id=\"controllers\""), HasSubstr("another experiment"), HasSubstr("height of the sole [m]"),
                  HasSubstr("id=\"training\""), HasSubstr("&lt;curves&gt;.csv"), HasSubstr("return against steps")));
  EXPECT_THAT(html_of(content()), AllOf(Not(HasSubstr("id=\"controllers\"")), Not(HasSubstr("id=\"training\""))));
}

TEST(HtmlReport, ShowsPoliciesPerturbationsAndReactivity) {
  std::vector<EpisodeRow> rows;
  for (const char* perturbation : {"clean", "later_1.0"}) {
    for (int i = 0; i < 6; ++i) {
      EpisodeRow row = test::engine_episode("mujoco", "<dstar>", i, i < 4);
      row.perturbation = perturbation;
      if (row.perturbation != "clean")
        row.tags = RowTags(Tags{{std::string(kFamilyTag), "later"}, {std::string(kSizeTag), "1"}});
      row.metrics = {{"partner_onset_s", row.perturbation == "clean" ? 2.0 : 3.0}, {"onset_s", 4.0}};
      rows.push_back(row);
    }
  }
  ReportContent shown = content();
  shown.analyses = run_analyses(run_tables(rows, {}, nullptr));
  const std::string html = html_of(shown);
  EXPECT_EQ(unbalanced_tag(html), "");
  EXPECT_THAT(html,
              AllOf(HasSubstr("id=\"policies\""), HasSubstr("id=\"degradation\""), HasSubstr("id=\"reactivity\""),
                    HasSubstr("success [%]"), HasSubstr("shift of the partner's onset"), Not(HasSubstr("<dstar>"))));
  for (const char* section : {"id=\"policies\"", "id=\"degradation\"", "id=\"reactivity\""})
    EXPECT_THAT(html_of(content()), Not(HasSubstr(section)));
}

TEST(FootPlots, OneEpisodePerControllerThatEndedWellFirst) {
  EpisodeRow still = walking("vmc", 0, Outcome::kOk);
  still.feet = {};
  EpisodeRow null = walking("null_arm", 0, Outcome::kOk);
  null.arm = "null";
  EpisodeRow pushed = walking("homie", 1, Outcome::kOk);
  pushed.perturbation = "push";
  const std::vector<LinePlot> plots =
      foot_plots({walking("homie", 0, Outcome::kFell), pushed, walking("homie", 4, Outcome::kOk),
                  walking("wbc_sim", 0, Outcome::kFell), still, null});
  ASSERT_EQ(plots.size(), 2U);
  EXPECT_THAT(plots[0].title, AllOf(HasSubstr("homie: hug-1 in mujoco"), Not(HasSubstr("push"))));
  EXPECT_SENTENCE(plots[1].title);
  EXPECT_EQ(plots[0].series.at(0).y, (std::vector<double>{0.0, 0.06, 0.0}));
  EXPECT_EQ(plots[0].series.at(1).x, (std::vector<double>{0.0, 0.04, 0.08}));
}

}  // namespace
}  // namespace duet
