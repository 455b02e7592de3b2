#include "duet/results/analyses/analysis.h"

#include <gmock/gmock.h>

namespace duet {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

std::string markdown(const int& n) { return "md " + std::to_string(n); }
std::string csv(const int& n) { return "csv " + std::to_string(n); }
std::string latex(const int&) { return ""; }
nlohmann::json json(const int& n) { return {{"n", n}}; }

TEST(Analysis, EachFormatIsAFileOfItsName) {
  const int one = 1, two = 2;
  const std::vector<Analysis> analyses = {analysis_of("one", one, markdown, csv, latex, json),
                                          analysis_of("two", two, markdown, csv, latex, json)};
  EXPECT_THAT(analysis_files(analyses, "md"), ElementsAre(Pair("one.md", "md 1"), Pair("two.md", "md 2")));
  EXPECT_THAT(analysis_files(analyses, "csv"), ElementsAre(Pair("one.csv", "csv 1"), Pair("two.csv", "csv 2")));
  EXPECT_THAT(analysis_files(analyses, "json"),
              ElementsAre(Pair("one.json", "{\n  \"n\": 1\n}\n"), Pair("two.json", "{\n  \"n\": 2\n}\n")));
  EXPECT_THAT(analysis_files(analyses, "tex"), IsEmpty());  // a file with nothing in it is none
  EXPECT_THAT(analysis_files(analyses, "html"), IsEmpty());
}

TEST(Analysis, EachIsAMemberOfItsName) {
  const int one = 1;
  nlohmann::json found = {{"files", 3}};
  add_analyses({analysis_of("one", one, markdown, csv, latex, json)}, found);
  EXPECT_EQ(found, (nlohmann::json{{"files", 3}, {"one", {{"n", 1}}}}));
}

}  // namespace
}  // namespace duet
