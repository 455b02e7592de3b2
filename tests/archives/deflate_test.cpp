#include <gtest/gtest.h>

#include "duet/archives/zip/zip.h"

namespace duet {
namespace {

TEST(Deflate, ComesBackWhole) {
  std::string bytes;
  for (const std::size_t size : {0U, 1U, 3U, 70000U}) {
    bytes.resize(size);
    for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>(i * i >> 3);
    EXPECT_EQ(inflated(deflated(bytes), "bytes", 100000), bytes) << size;
  }
  EXPECT_LT(deflated(std::string(70000, 'a')).size(), 200U);
}

// The vectors of RFC 4648.
TEST(Base64, IsTheStandards) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64(std::string("\xff\xfe\xfd\x00", 4)), "//79AA==");
}

}  // namespace
}  // namespace duet
