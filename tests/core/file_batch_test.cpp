#include "duet/core/file_batch.h"

#include "tests/file_size_limit.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using test::FileSizeLimit;
using test::ScratchFolder;
using test::thrown_message;

long files_in(const std::string& folder) { return std::distance(fs::directory_iterator(folder), {}); }

TEST(FileBatch, PutsAllInPlaceAtTheEnd) {
  const ScratchFolder folder;
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
  const ScratchFolder folder;
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
  const ScratchFolder folder;
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

}  // namespace
}  // namespace duet
