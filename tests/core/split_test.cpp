#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "duet/core/require.h"

namespace duet {
namespace {

using ::testing::ElementsAre;

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

}  // namespace
}  // namespace duet
