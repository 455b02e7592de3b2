#include <fmt/format.h>
#include <gmock/gmock.h>

#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

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
