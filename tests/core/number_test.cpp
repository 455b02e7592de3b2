#include <gtest/gtest.h>

#include "duet/core/require.h"

namespace duet {
namespace {

TEST(Number, IsTheWholeText) {
  EXPECT_EQ(parse_number("0.25"), 0.25);
  EXPECT_EQ(parse_number("-3e2"), -300.0);
  for (const char* text : {"", " 1", "1 ", "1,5", "0.5m", "nan", "inf", "1e999", "+1", "one"})
    EXPECT_EQ(parse_number(text), std::nullopt) << text;
}

}  // namespace
}  // namespace duet
