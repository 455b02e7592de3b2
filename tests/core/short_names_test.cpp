#include <gtest/gtest.h>

#include "duet/core/require.h"

namespace duet {
namespace {

TEST(WithShortNames, CutsNamesInTheirMiddlesAndNothingElse) {
  const std::string sentence =
      "unknown task 'hugg': did you mean 'hug'? Known: hug, handshake and many more, it's said";
  EXPECT_EQ(with_short_names(sentence, 10), sentence);
  EXPECT_EQ(with_short_names("cannot read '" + std::string(50, 'a') + "z': no", 10), "cannot read 'aaaa...aaaz': no");
  EXPECT_EQ(with_short_names(std::string(50, 'a'), 10), "aaaaa...aaaaa");
  EXPECT_EQ(with_short_names("", 10), "");
}

TEST(WithShortNames, TakesAQuotedNameWithSpacesForOne) {
  std::string path;
  for (int i = 0; i < 100; ++i) path += "/my folder";
  const std::string told = with_short_names("cannot read '" + path + "': No such file; again '" + path + "'");
  EXPECT_LT(told.size(), 900U);
  EXPECT_TRUE(told.starts_with("cannot read '/my folder/my folder")) << told;
  EXPECT_NE(told.find("/my folder': No such file; again '/my"), std::string::npos) << told;
}

TEST(WithShortNames, CutsNoCharacterInTwo) {
  std::string name;
  for (int i = 0; i < 400; ++i) name += "ü";
  for (std::size_t most = 20; most < 24; ++most)
    EXPECT_EQ(excerpt(with_short_names(name, most)).find("\\x"), std::string::npos) << most;
}

}  // namespace
}  // namespace duet
