#include "duet/core/file_batch.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <filesystem>

#include "duet/core/file.h"
#include "tests/file_size_limit.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using test::FileSizeLimit;
using test::thrown_message;
using ::testing::StartsWith;

long files_in(const std::string& folder) { return std::distance(fs::directory_iterator(folder), {}); }

TEST(FileBatch, PutsAllInPlaceAtTheEnd) {
  const test::ScratchFolder folder;
  write_file(folder / "a", "old");
  FileBatch batch;
  batch.write(folder / "a", "first");
  batch.write(folder / "a", "new");
  batch.write(folder / "deep/b", "b");
  EXPECT_EQ(read_file(folder / "a"), "old");
  batch.put_in_place();
  EXPECT_EQ(read_file(folder / "a"), "new");
  EXPECT_EQ(read_file(folder / "deep/b"), "b");
  EXPECT_EQ(files_in(folder / ""), 2);
}

TEST(FileBatch, AFullDiskLeavesTheOldFilesAndNothingElse) {
  const test::ScratchFolder folder;
  write_file(folder / "a", "old");
  {
    FileBatch batch;
    batch.write(folder / "a", "new");
    batch.write(folder / "b", "new");
    const FileSizeLimit full(1000);
    EXPECT_SENTENCE(thrown_message<StorageError>([&] { batch.write(folder / "c", std::string(2000, 'c')); }));
  }
  EXPECT_EQ(read_file(folder / "a"), "old");
  EXPECT_EQ(files_in(folder / ""), 1);
}

TEST(FileBatch, WritesToADeviceInsteadOfReplacingIt) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "not run: /dev/full absent";
  FileBatch batch;
  batch.write("/dev/full", "x");
  EXPECT_SENTENCE(thrown_message<StorageError>([&] { batch.put_in_place(); }));
}

TEST(FileBatch, KeepsLinksAndPermissionsAndNamesAFolder) {
  const test::ScratchFolder folder;
  write_file(folder / "a", "old");
  fs::permissions(folder / "a", fs::perms::owner_read | fs::perms::owner_write);
  fs::create_symlink("a", folder / "link");
  FileBatch batch;
  batch.write(folder / "link", "new");
  EXPECT_EQ(thrown_message<StorageError>([&] { batch.write(folder / "", "x"); }),
            "cannot write '" + (folder / "") + "': Is a directory");
  batch.put_in_place();
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(read_file(folder / "a"), "new");
  EXPECT_EQ(fs::status(folder / "a").permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

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
