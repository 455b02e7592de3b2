#include "duet/core/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "duet/core/file_batch.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "tests/file_size_limit.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::FileSizeLimit;
using test::ScratchFolder;
using test::thrown_message;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::vector<std::string> names_in(const ScratchFolder& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "")) names.push_back(entry.path().filename());
  return names;
}

TEST(ReadFile, ReturnsEveryByte) {
  const ScratchFolder folder;
  std::string bytes;
  for (int i = 0; i < 300000; ++i) bytes += static_cast<char>(i * 7);
  write_file(folder / "bytes", bytes);
  EXPECT_EQ(read_file(folder / "bytes"), bytes);
  write_file(folder / "empty", "");
  EXPECT_EQ(read_file(folder / "empty"), "");
}

TEST(ReadFile, NamesPathAndReason) {
  const ScratchFolder folder;
  EXPECT_EQ(thrown_message<InputError>([&] { read_file(folder / "x.bvh"); }),
            "cannot read '" + (folder / "x.bvh") + "': No such file or directory");
  EXPECT_EQ(thrown_message<InputError>([&] { read_file(folder / ""); }),
            "cannot read '" + (folder / "") + "': Is a directory");
}

TEST(WriteFile, CreatesParentsAndLeavesNoTemporaryFile) {
  const ScratchFolder folder;
  write_file(folder / "a/b/c.json", "1");
  write_file(folder / "a/b/c.json", "2");
  EXPECT_EQ(read_file(folder / "a/b/c.json"), "2");
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "a/b")) count += entry.exists() ? 1 : 0;
  EXPECT_EQ(count, 1);
}

TEST(WriteFile, WorksWithoutAFolderInThePath) {
  const ScratchFolder folder;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder / "");
  write_file("plain.txt", "x");
  std::filesystem::current_path(before);
  EXPECT_EQ(read_file(folder / "plain.txt"), "x");
}

TEST(WriteFile, FullDiskLeavesTheOldFileAndNoTemporaryFile) {
  const ScratchFolder folder;
  write_file(folder / "run.json", "old");
  std::string message;
  {
    const FileSizeLimit limit(1000);
    message = thrown_message<InputError>([&] { write_file(folder / "run.json", std::string(5000, 'x')); });
  }
  EXPECT_EQ(message, "cannot write '" + (folder / "run.json") + "': File too large");
  EXPECT_EQ(read_file(folder / "run.json"), "old");
  EXPECT_EQ(names_in(folder), std::vector<std::string>{"run.json"});
}

TEST(WriteFile, FullDiskLeavesNothingOfANewFile) {
  const ScratchFolder folder;
  {
    const FileSizeLimit limit(1000);
    EXPECT_THROW(write_file(folder / "new.json", std::string(5000, 'x')), InputError);
  }
  EXPECT_TRUE(names_in(folder).empty());
}

TEST(WriteFile, WritesToADeviceInsteadOfReplacingIt) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "not run: /dev/full absent";
  EXPECT_SENTENCE(thrown_message<InputError>([] { write_file("/dev/full", "x"); }));
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(WriteFile, NamesPathAndReason) {
  const ScratchFolder folder;
  write_file(folder / "file", "x");
  EXPECT_EQ(thrown_message<InputError>([&] { write_file(folder / "file/y", "1"); }),
            "cannot write '" + (folder / "file/y") + "': Not a directory");
  std::filesystem::create_directory(folder / "d");
  EXPECT_EQ(thrown_message<InputError>([&] { write_file(folder / "d", "1"); }),
            "cannot write '" + (folder / "d") + "': Is a directory");
}

TEST(WriteFile, KeepsPermissionsAndLinks) {
  const ScratchFolder folder;
  write_file(folder / "file", "old");
  ASSERT_EQ(chmod((folder / "file").c_str(), 0640), 0);
  std::filesystem::create_symlink("file", folder / "link");
  write_file(folder / "link", "new");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  EXPECT_EQ(read_file(folder / "file"), "new");
  struct stat status {};
  ASSERT_EQ(stat((folder / "file").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 07777, 0640u);
}

TEST(ReadFile, RefusesMoreThanItsLimitByName) {
  const ScratchFolder folder;
  write_file(folder / "ten", "0123456789");
  EXPECT_EQ(read_file(folder / "ten", 10), "0123456789");
  EXPECT_EQ(thrown_message<InputError>([&] { read_file(folder / "ten", 9); }),
            "cannot read '" + (folder / "ten") + "': expected at most 9 bytes, found more");
  if (!std::filesystem::exists("/dev/zero")) GTEST_SKIP() << "not run: /dev/zero absent";
  EXPECT_SENTENCE(thrown_message<InputError>([&] { read_text("/dev/zero"); }));
}

TEST(Inside, RefusesLinksBelowTheFolderAndFollowsTheFolderItself) {
  const ScratchFolder folder;
  std::filesystem::create_directories(folder / "run/real");
  write_file(folder / "outside", "mine");
  std::filesystem::create_symlink(folder / "outside", folder / "run/table.md");
  std::filesystem::create_symlink(folder / "nowhere", folder / "run/dangling.md");
  std::filesystem::create_symlink(folder / "run/real", folder / "run/traces");
  std::filesystem::create_symlink(folder / "run", folder / "link");
  EXPECT_EQ(join_without_links(folder / "run", "real/a.npz"), folder / "run/real/a.npz");
  EXPECT_EQ(join_without_links(folder / "link", "new.md"), folder / "link/new.md");
  EXPECT_EQ(thrown_message<StorageError>([&] { static_cast<void>(join_without_links(folder / "run", "table.md")); }),
            "cannot write '" + (folder / "run/table.md") + "': '" + (folder / "run/table.md") +
                "' is a symbolic link and may lead out of the folder; remove it");
  for (const char* name : {"dangling.md", "traces/a.npz"})
    EXPECT_NE(thrown_message<StorageError>([&] { static_cast<void>(join_without_links(folder / "run", name)); }),
              "(nothing was thrown)")
        << name;
}

TEST(LineAppender, ReadsWhatOthersAppendedAndCutsARestOnlyWhenAsked) {
  const ScratchFolder folder;
  LineAppender a(folder / "lines"), b(folder / "lines");
  a.append("one");
  a.append("two");
  EXPECT_EQ(b.read_appended(true), "one\ntwo\n");
  EXPECT_EQ(b.read_appended(true), "");
  const int descriptor = open((folder / "lines").c_str(), O_WRONLY | O_APPEND);
  ASSERT_EQ(write(descriptor, "thr", 3), 3);
  close(descriptor);
  EXPECT_EQ(b.read_appended(false), "");
  EXPECT_EQ(read_file(folder / "lines"), "one\ntwo\nthr");
  EXPECT_EQ(b.read_appended(true), "");
  b.append("three");
  EXPECT_EQ(read_file(folder / "lines"), "one\ntwo\nthree\n");
}

TEST(LineAppender, NoticesAFileThatWasMadeShorterOrRemoved) {
  const ScratchFolder folder;
  LineAppender lines(folder / "lines");
  lines.append("one");
  std::filesystem::resize_file(folder / "lines", 0);
  EXPECT_EQ(thrown_message<StorageError>([&] { lines.read_appended(true); }),
            "cannot write '" + (folder / "lines") + "': it was made shorter while rows were written to it");
  std::filesystem::remove(folder / "lines");
  EXPECT_EQ(thrown_message<StorageError>([&] { lines.read_appended(true); }),
            "cannot write '" + (folder / "lines") + "': it was removed while rows were written to it");
}

TEST(LineAppender, EachLineIsThereWhenAppendReturns) {
  const ScratchFolder folder;
  LineAppender lines(folder / "runs/episodes.jsonl");
  EXPECT_EQ(read_file(folder / "runs/episodes.jsonl"), "");
  lines.append("{\"a\":1}");
  EXPECT_EQ(read_file(folder / "runs/episodes.jsonl"), "{\"a\":1}\n");
  lines.append("");
  EXPECT_EQ(read_file(folder / "runs/episodes.jsonl"), "{\"a\":1}\n\n");
}

TEST(LineAppender, ContinuesAndCutsAPartOfALine) {
  const ScratchFolder folder;
  const std::string part(10000, 'x');  // longer than one block of the search for the last newline
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", ""}, {"one\n", "one\n"}, {"one\ntw", "one\n"}, {"tw", ""}, {"one\ntwo\n" + part, "one\ntwo\n"}, {part, ""}};
  for (const auto& [before, kept] : cases) {
    write_file(folder / "lines", before);
    LineAppender(folder / "lines").append("next");
    EXPECT_EQ(read_file(folder / "lines"), kept + "next\n");
  }
}

TEST(LineAppender, CutsALineThatTheDiskDidNotTakeWhole) {
  const ScratchFolder folder;
  LineAppender lines(folder / "lines");
  lines.append("first");
  std::string message;
  {
    const FileSizeLimit limit(100);
    message = thrown_message<InputError>([&] { lines.append(std::string(500, 'x')); });
    EXPECT_EQ(read_file(folder / "lines"), "first\n");
  }
  EXPECT_EQ(message, "cannot write '" + (folder / "lines") + "': File too large");
  lines.append("second");
  EXPECT_EQ(read_file(folder / "lines"), "first\nsecond\n");
}

// A device has nothing to sync, and that is no fault.
TEST(LineAppender, WritesToADevice) {
  LineAppender file("/dev/null");
  EXPECT_NO_THROW(file.append("a line"));
}

TEST(LineAppender, NamesAFullDisk) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "not run: /dev/full absent";
  LineAppender lines("/dev/full");
  EXPECT_SENTENCE(thrown_message<StorageError>([&] { lines.append("x"); }));
}

TEST(LineAppender, RefusesANewlineAndAFolder) {
  const ScratchFolder folder;
  LineAppender lines(folder / "lines");
  EXPECT_EQ(thrown_message<std::invalid_argument>([&] { lines.append("a\nb"); }),
            "'" + (folder / "lines") + "': a line must not hold a newline");
  EXPECT_EQ(thrown_message<InputError>([&] { LineAppender appender(folder / ""); }),
            "cannot write '" + (folder / "") + "': Is a directory");
}

template <typename Error>
std::string told(const std::string& message) {
  return thrown_message<InputError>([&] { with_file_context("a.npz", [&] { throw Error(message); }); });
}

TEST(NamingFile, PutsTheFileBeforeWhatDoesNotNameIt) {
  EXPECT_SENTENCE(told<InputError>("nothing pairs"));
  EXPECT_SENTENCE(told<std::invalid_argument>("expected frames"));
  EXPECT_SENTENCE(told<InputError>("'a.npz': key 'b'"));
}

TEST(NamingFile, SaysThatThereIsNotEnoughMemoryForAFile) {
  EXPECT_SENTENCE(thrown_message<InputError>([] { with_file_context("a.npz", [] { throw std::bad_alloc(); }); }));
}

TEST(NamingFile, LetsValuesAndOtherExceptionsThrough) {
  int value = 3;
  EXPECT_EQ(&with_file_context("a.npz", [&]() -> int& { return value; }), &value);
  EXPECT_EQ(thrown_message<MissingError>([] { with_file_context("a.npz", [] { throw MissingError("no engine"); }); }),
            "no engine");
  EXPECT_EQ(thrown_message<StorageError>([] { with_file_context("a.npz", [] { throw StorageError("disk full"); }); }),
            "disk full");
}

TEST(MemoryLeft, IsTheLeastOfMachineAndGroups) {
  const test::ScratchFolder folder;
  const std::string root = folder / "root";
  write_file(root + "/proc/meminfo", "MemTotal:  4000000 kB\nMemAvailable:  2000000 kB\nSwapTotal: 0 kB\n");
  EXPECT_DOUBLE_EQ(memory_left(root), 2048.0e6);
  write_file(root + "/proc/self/cgroup", "3:cpu:/x\n0::/user/job\n");
  write_file(root + "/sys/fs/cgroup/user/memory.max", "max\n");
  write_file(root + "/sys/fs/cgroup/user/memory.current", "5\n");
  EXPECT_DOUBLE_EQ(memory_left(root), 2048.0e6);
  write_file(root + "/sys/fs/cgroup/user/job/memory.max", "900000000\n");
  write_file(root + "/sys/fs/cgroup/user/job/memory.current", "700000000\n");
  EXPECT_DOUBLE_EQ(memory_left(root), 200.0e6);
  write_file(root + "/sys/fs/cgroup/user/job/memory.stat", "anon 600000000\ninactive_file 100000000\n");
  EXPECT_DOUBLE_EQ(memory_left(root), 300.0e6);
  write_file(root + "/sys/fs/cgroup/user/memory.max", "4\n");  // a group above it
  EXPECT_DOUBLE_EQ(memory_left(root), 0.0);
}

TEST(MemoryLeft, KnowsTheFirstVersionOfGroups) {
  const test::ScratchFolder folder;
  const std::string root = folder / "root";
  write_file(root + "/sys/fs/cgroup/memory/memory.limit_in_bytes", "1000000000\n");
  write_file(root + "/sys/fs/cgroup/memory/memory.usage_in_bytes", "400000000\n");
  write_file(root + "/sys/fs/cgroup/memory/memory.stat", "inactive_file 1\ntotal_inactive_file 100000000\n");
  EXPECT_DOUBLE_EQ(memory_left(root), 700.0e6);
}

TEST(RequireMemory, SaysWhatNeedsItBeforeTheWork) {
  EXPECT_NO_THROW(require_memory("clip 'a': 5 frames", 1e5));
  const std::string told = test::thrown_message<InputError>([] { require_memory("clip 'hour': 180000 frames", 1e18); });
  EXPECT_THAT(told, HasSubstr("clip 'hour': 180000 frames need about 1000000000.0 GB of memory, and "));
  EXPECT_THAT(told, HasSubstr(" GB are left"));
}

}  // namespace
}  // namespace duet
