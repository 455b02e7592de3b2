#include "duet/core/names.h"

#include "tests/support.h"

namespace duet {
namespace {

const std::vector<std::string> kKnown = {"hug", "handshake", "high_five", "wave", "bend", "fly_kiss"};

TEST(ClosestName, FindsOneSlipOfEachKind) {
  EXPECT_EQ(closest_name("hugg", kKnown), "hug");
  EXPECT_EQ(closest_name("handshke", kKnown), "handshake");
  EXPECT_EQ(closest_name("wabe", kKnown), "wave");
  EXPECT_EQ(closest_name("bned", kKnown), "bend");
}

TEST(ClosestName, IgnoresCaseAndTheKindOfDash) {
  EXPECT_EQ(closest_name("HIGH-FIVE", kKnown), "high_five");
  EXPECT_EQ(closest_name("Fly-Kis", kKnown), "fly_kiss");
}

TEST(ClosestName, CountsASwapOfNeighboursOnce) {
  // Without it "abcdef" <- "badcfe" would be 6 edits and out of reach; with it there are 3, which is above 6 / 3.
  EXPECT_EQ(closest_name("badcef", std::vector<std::string>{"abcdef"}), "abcdef");
  EXPECT_EQ(closest_name("badcfe", std::vector<std::string>{"abcdef"}), "");
}

TEST(ClosestName, IsEmptyWhereNothingIsNear) {
  EXPECT_EQ(closest_name("somersault", kKnown), "");
  EXPECT_EQ(closest_name("", kKnown), "");
  EXPECT_EQ(closest_name("hug", {}), "");
  EXPECT_EQ(closest_name("zz", std::vector<std::string>{"ab"}), "");  // two edits, and nothing shared
}

TEST(ClosestName, ReachesAThirdOfTheLength) {
  const std::vector<std::string> known = {"abcdefghijkl"};
  EXPECT_EQ(closest_name("abcdefghXXXX", known), "abcdefghijkl");  // 4 of 12
  EXPECT_EQ(closest_name("abcdefgXXXXX", known), "");              // 5 of 12
}

TEST(UnknownNameMessage, AsksOnlyWhereANameIsNear) {
  EXPECT_SENTENCE(unknown_name_message("task", "hugg", kKnown));
  EXPECT_SENTENCE(unknown_name_message("task", "somersault", kKnown));
  EXPECT_SENTENCE(unknown_name_message("engine", "x", {}));
}

TEST(UnknownNameMessage, OfALongListShowsTheNearest) {
  std::vector<std::string> known;
  for (int i = 0; i < 44; ++i) known.push_back("link_" + std::to_string(i));
  EXPECT_SENTENCE(unknown_name_message("frame", "lnk_43", known));
}

TEST(Names, OptionThatIsNotGivenFallsBack) {
  const std::map<std::string, std::string> options = {{"waist", "locked"}};
  EXPECT_EQ(option_or(options, "waist", "free"), "locked");
  EXPECT_EQ(option_or(options, "engine", "duet"), "duet");
  EXPECT_EQ(option_or(options, "language"), "");
}

}  // namespace
}  // namespace duet
