#include "duet/core/share.h"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

std::string folders_of(const std::string& program) {
  const std::string command = fmt::format("env -u DUET_SHARE '{}'", program);
  std::string text;
  FILE* pipe = ::popen(command.c_str(), "r");
  for (char line[4096]; std::fgets(line, sizeof line, pipe) != nullptr;) text += line;
  ::pclose(pipe);
  return text;
}

TEST(ShareFile, AProgramWhereItWasBuiltReadsTheSources) {
  EXPECT_EQ(share_file("licence", "LICENSE"), (fs::path(DUET_SOURCE_DIR) / "LICENSE").string());
  const std::optional<BuildTree> tree = build_tree_of(program_file());
  ASSERT_TRUE(tree.has_value());
  EXPECT_TRUE(fs::equivalent(tree->sources, DUET_SOURCE_DIR));
}

// Anyone who can write where it was built could give robots and engines to all users of the machine.
TEST(ShareFile, AProgramThatIsInstalledReadsNothingOfTheTreeItWasBuiltIn) {
  const test::ScratchFolder scratch;
  fs::create_directories(scratch / "bin");
  fs::copy_file(DUET_PRINT_SHARE_FOLDERS, scratch / "bin/program");
  const std::string share = "folder " + fs::canonical(scratch / "").string() + "/share/duet\n";
  EXPECT_EQ(folders_of(scratch / "bin/program"), share);
  write_file(scratch / "share/duet/LICENSE", "installed");
  EXPECT_EQ(folders_of(scratch / "bin/program"), share);
  // The same below a folder where another duet was built.
  write_file(scratch / "CMakeCache.txt",
             "duet_SOURCE_DIR:STATIC=/elsewhere\nduet_BINARY_DIR:STATIC=/elsewhere/build\n");
  EXPECT_EQ(folders_of(scratch / "bin/program"), share);
  fs::remove(scratch / "share/duet/LICENSE");
  EXPECT_EQ(folders_of(scratch / "bin/program"), share + "folder /elsewhere\n");
}

TEST(BuildTree, IsThatOfTheNearestCacheWhichNamesDuet) {
  const test::ScratchFolder scratch;
  write_file(scratch / "build/bench/program", "");
  EXPECT_FALSE(build_tree_of(scratch / "build/bench/program").has_value());
  write_file(scratch / "CMakeCache.txt", "duet_SOURCE_DIR:STATIC=/far\nduet_BINARY_DIR:STATIC=/far/build\n");
  EXPECT_EQ(build_tree_of(scratch / "build/bench/program")->sources, "/far");
  write_file(scratch / "build/CMakeCache.txt", "# of a stranger's project\nduet_DIR:PATH=/usr/lib/cmake/duet\n");
  EXPECT_FALSE(build_tree_of(scratch / "build/bench/program").has_value());
  write_file(scratch / "build/CMakeCache.txt",
             "CMAKE_HOME_DIRECTORY:INTERNAL=/mine\nduet_BINARY_DIR:STATIC=/mine/build/duet\n"
             "duet_SOURCE_DIR:STATIC=/mine/duet\n");
  const std::optional<BuildTree> tree = build_tree_of(scratch / "build/bench/program");
  ASSERT_TRUE(tree.has_value());
  EXPECT_EQ(tree->sources, "/mine/duet");
  EXPECT_EQ(tree->build, "/mine/build/duet");
}

TEST(ShareFile, MissingFilesAreRefusedWithThePlaces) {
  EXPECT_SENTENCE(test::thrown_message<MissingError>([] { share_file("robot card", "robots/none.yaml"); }));
}

}  // namespace
}  // namespace duet
