#include <gmock/gmock.h>
#include <sys/stat.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using testing::StartsWith;

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename());
  return names;
}

TEST(ScratchFolder, IsOneOfItsOwnAndGoesWithAllThatIsInIt) {
  const test::ScratchFolder outside;
  write_file(outside / "precious", "mine");
  std::string path;
  {
    const ScratchFolder one, other;
    path = one.path();
    EXPECT_NE(one.path(), other.path());
    struct stat status {};
    ASSERT_EQ(::stat(path.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 07777U, 0700U);  // nobody else looks into it
    write_file(one / "deep/file", "x");
    fs::create_directory_symlink(outside / ".", one / "link");
  }
  EXPECT_FALSE(fs::exists(path));
  EXPECT_EQ(read_file(outside / "precious"), "mine");
}

TEST(ScratchFolder, StandsBesideWhatItBecomes) {
  const test::ScratchFolder folder;
  {
    const ScratchFolder scratch = ScratchFolder::beside(folder / "new/out/");
    EXPECT_THAT(scratch.path(), StartsWith(folder / "new/out.part-"));
    write_file(scratch / "made/file", "x");
    scratch.publish("made", folder / "new/out/");
  }
  EXPECT_THAT(names_in(folder / "new"), testing::ElementsAre("out"));
  EXPECT_EQ(read_file(folder / "new/out/file"), "x");
}

TEST(ScratchFolder, TakesNoPlaceThatIsTaken) {
  const test::ScratchFolder folder;
  fs::create_directory(folder / "out");  // empty: a rename would replace it
  const ScratchFolder scratch = ScratchFolder::beside(folder / "out");
  write_file(scratch / "made/file", "x");
  EXPECT_SENTENCE(test::thrown_message<StorageError>([&] { scratch.publish("made", folder / "out"); }));
  EXPECT_TRUE(fs::is_empty(folder / "out"));
}

TEST(ScratchFolder, SaysWhereItCannotBe) {
  const test::ScratchFolder folder;
  write_file(folder / "file", "x");
  EXPECT_SENTENCE(test::thrown_message<StorageError>([&] { ScratchFolder::beside(folder / "file/out"); }));
}

}  // namespace
}  // namespace duet
