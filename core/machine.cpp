#include "duet/core/machine.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <thread>

#include "duet/core/require.h"

namespace duet {
namespace {

double seconds_by(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

double monotonic_seconds() { return seconds_by(CLOCK_MONOTONIC); }

double thread_computed_seconds() { return seconds_by(CLOCK_THREAD_CPUTIME_ID); }

double AwakeTime::look() {
  const double now = clock_(), gap = now - last_;
  last_ = now;
  if (gap <= kLongestGap) awake_ += gap;
  return awake_;
}

std::chrono::milliseconds AwakeDeadline::left() {
  const double left = static_cast<double>(time_.count()) - 1000.0 * awake_.look();
  return std::chrono::milliseconds(static_cast<std::int64_t>(std::ceil(std::max(left, 0.0))));
}

namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();
constexpr double kAskedFrom = 256.0e6;  // [bytes]; a program that has less left does not get as far as this

// The number of a file of one number; nothing where it says "max" or is not there.
std::optional<double> number_in(const std::filesystem::path& path) {
  double value = 0.0;
  if (std::ifstream(path) >> value) return value;
  return std::nullopt;
}

// The number that follows `key` in a file of keys and numbers.
std::optional<double> number_after(const std::filesystem::path& path, const std::string& key) {
  std::ifstream file(path);
  for (std::string word; file >> word;) {
    double value = 0.0;
    if (word == key && file >> value) return value;
    file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return std::nullopt;
}

// Pages of files that a group has read count as used, and are given up where memory is wanted.
double group_left(const std::filesystem::path& folder, const char* limit, const char* used, const char* given_up) {
  const std::optional<double> most = number_in(folder / limit), now = number_in(folder / used);
  if (!most || !now) return kUnlimited;
  return std::max(0.0, *most - *now + number_after(folder / "memory.stat", given_up).value_or(0.0));
}

// The path of this process's group in version 2: the line "0::/user.slice/job".
std::string group_of(const std::string& root) {
  std::ifstream file(root + "/proc/self/cgroup");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("0::/")) return line.substr(4);
  return "";
}

double groups_left(const std::string& root) {
  const std::filesystem::path top = root + "/sys/fs/cgroup";
  double left = group_left(top / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file");
  left = std::min(left, group_left(top, "memory.max", "memory.current", "inactive_file"));
  std::filesystem::path folder = top;
  for (const std::filesystem::path& part : std::filesystem::path(group_of(root))) {
    folder /= part;
    left = std::min(left, group_left(folder, "memory.max", "memory.current", "inactive_file"));
  }
  return left;
}

double address_space_left(const std::string& root) {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kUnlimited;
  const double used = number_in(root + "/proc/self/statm").value_or(0.0) * static_cast<double>(sysconf(_SC_PAGESIZE));
  return std::max(0.0, static_cast<double>(limit.rlim_cur) - used);
}

}  // namespace

double memory_left(const std::string& root) {
  const std::optional<double> free = number_after(root + "/proc/meminfo", "MemAvailable:");
  const double machine = free ? 1024.0 * *free : kUnlimited;
  return std::min({machine, groups_left(root), address_space_left(root)});
}

void require_memory(const std::string& work, double bytes) {
  if (bytes < kAskedFrom) return;
  const double left = memory_left();
  if (bytes > left)
    throw InputError(
        fmt::format("{} need about {:.1f} GB of memory, and {:.1f} GB are left", work, 1e-9 * bytes, 1e-9 * left));
}

void parallel_for_each(int count, int threads, const std::function<void(int)>& work) {
  // Indices are handed out in order, so that a stopped run has finished the first episodes and not scattered ones.
  std::atomic<int> next{0};
  // More threads than cores are of use where the work waits for somebody: oneTBB gives them only where it is told to.
  std::optional<tbb::global_control> more;
  if (threads > default_threads()) more.emplace(tbb::global_control::max_allowed_parallelism, threads);
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_for(
        0, std::min(threads, count),
        [&](int) {
          for (int i = next++; i < count; i = next++) {
            try {
              work(i);
            } catch (...) {
              next = count;
              throw;
            }
          }
        },
        tbb::static_partitioner());
  });
}

int default_threads() { return std::max(1U, std::thread::hardware_concurrency()); }

namespace {

#if defined(__x86_64__)
bool has_avx2() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
         __builtin_cpu_supports("bmi2");
}

bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}
#endif

}  // namespace

std::string_view to_string(InstructionSet set) {
  switch (set) {
    case InstructionSet::kV4:
      return "x86-64-v4";
    case InstructionSet::kV3:
      return "x86-64-v3";
    case InstructionSet::kV2:
      return "x86-64-v2";
    default:
      return "portable";
  }
}

bool runs_here([[maybe_unused]] InstructionSet set) {
#if defined(__x86_64__)
  __builtin_cpu_init();
  switch (set) {
    case InstructionSet::kV4:
      return has_avx2() && has_avx512();
    case InstructionSet::kV3:
      return has_avx2();
    default:
      return true;  // all of duet is compiled for x86-64-v2
  }
#else
  return set == InstructionSet::kPortable;
#endif
}

}  // namespace duet
