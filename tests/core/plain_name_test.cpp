#include <gtest/gtest.h>

#include "duet/core/names.h"
#include "tests/support.h"

namespace duet {
namespace {

TEST(PlainName, HasLettersDigitsAndFourSigns) {
  for (const char* name : {"a", "kick_0.5", "push+delay", "A-1"}) EXPECT_TRUE(is_plain_name(name)) << name;
  // The last two are a formula of a spreadsheet, an option of a command line.
  for (const char* name : {"", "a b", "a/b", "a,b", "\xc3\xa4", "=1+2", "@a", "+1", "-2+3"})
    EXPECT_FALSE(is_plain_name(name)) << name;
  EXPECT_SENTENCE(plain_name_message("a b"));
}

}  // namespace
}  // namespace duet
