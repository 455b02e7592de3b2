#include "duet/core/share.h"

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

// A program that is installed must not read the sources of the machine that built it.
TEST(ShareFile, BesideTheProgramComesBeforeTheSourceTree) {
  const fs::path installed = fs::read_symlink("/proc/self/exe").parent_path().parent_path() / "share" / "duet";
  ASSERT_FALSE(fs::exists(installed / "LICENSE"));
  EXPECT_EQ(share_file("licence", "LICENSE"), (fs::path(DUET_SOURCE_DIR) / "LICENSE").string());
  fs::create_directories(installed);
  write_file((installed / "LICENSE").string(), "installed");
  const std::string found = share_file("licence", "LICENSE");
  fs::remove(installed / "LICENSE");
  EXPECT_EQ(found, (installed / "LICENSE").string());
}

TEST(ShareFile, MissingFilesAreRefusedWithThePlaces) {
  EXPECT_THAT(test::thrown_message<MissingError>([] { share_file("robot card", "robots/none.yaml"); }),
              ::testing::AllOf(::testing::HasSubstr("no robot card: looked at"),
                               ::testing::HasSubstr("share/duet/robots/none.yaml")));
}

}  // namespace
}  // namespace duet
