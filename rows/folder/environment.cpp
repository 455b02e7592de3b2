#include "duet/rows/folder/environment.h"

#include <fmt/format.h>
#include <gnu/libc-version.h>
#include <sched.h>
#include <sqlite3.h>
#include <sys/sysinfo.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cfenv>
#include <clocale>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "build_info.h"
#include "duet/core/require.h"

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace duet {
namespace {

using nlohmann::json;

// Those that decide which code runs and how it rounds.
constexpr std::array<std::string_view, 16> kFlagsThatMatter = {
    "sse4_2",   "avx",      "fma",      "f16c",        "avx2",        "bmi2",     "avx512f", "avx512dq",
    "avx512bw", "avx512vl", "avx512cd", "avx512_vnni", "avx512_bf16", "amx_tile", "asimd",   "sve"};

constexpr std::string_view kBlanks = " \t\n";

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return std::string(trimmed(line, kBlanks));
}

// The value of the first "name : value" line, "" where there is none.
std::string proc_value(const std::string& path, std::string_view name) {
  std::ifstream file(path);
  for (std::string read; std::getline(file, read);) {
    const std::string_view line = read;
    const std::size_t colon = line.find(':');
    if (colon != std::string_view::npos && trimmed(line.substr(0, colon), kBlanks) == name)
      return std::string(trimmed(line.substr(colon + 1), kBlanks));
  }
  return "";
}

std::string processor_model() {
  const std::string name = proc_value("/proc/cpuinfo", "model name");
  return name.empty() ? "unknown processor" : name;
}

std::set<std::string> processor_flags() {
  std::string flags = proc_value("/proc/cpuinfo", "flags");
  if (flags.empty()) flags = proc_value("/proc/cpuinfo", "Features");
  std::istringstream words(flags);
  std::set<std::string> found;
  for (std::string word; words >> word;) {
    for (const std::string_view flag : kFlagsThatMatter) {
      if (word == flag) found.insert(word);
    }
  }
  return found;
}

std::string widest_vectors() {
  const std::set<std::string> flags = processor_flags();
  if (flags.contains("avx512f")) return "AVX-512";
  if (flags.contains("avx2")) return "AVX2";
  if (flags.contains("avx")) return "AVX";
  if (flags.contains("sse4_2")) return "SSE4.2";
  return flags.contains("asimd") ? "NEON" : "no SIMD";
}

// Cores that this process may use.
int usable_cores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof set, &set) == 0) return CPU_COUNT(&set);
  return static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
}

// The home folder names the user.
std::string without_home(std::string_view text) {
  const char* variable = std::getenv("HOME");
  const std::string_view home = variable != nullptr ? variable : "";
  if (home.size() < 2) return std::string(text);
  std::string result;
  for (std::size_t at = text.find(home); at != std::string_view::npos; at = text.find(home)) {
    result.append(text.substr(0, at)).append("~");
    text.remove_prefix(at + home.size());
  }
  return result.append(text);
}

json build() {
  return {{"version", build_info::kVersion},
          {"commit", build_info::kCommit},
          {"compiler", build_info::kCompiler},
          {"build_type", build_info::kBuildType},
          {"flags", std::string(build_info::kFlags)}};
}

json processor() {
  const std::filesystem::path governor = "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor";
  return {{"model", processor_model()},
          {"flags", processor_flags()},
          {"cores", sysconf(_SC_NPROCESSORS_ONLN)},
          {"usable_cores", usable_cores()},
          {"governor", first_line(governor.string())}};
}

json load() {
  std::array<double, 3> average{};
  const int count = getloadavg(average.data(), static_cast<int>(average.size()));
  return std::vector<double>(average.begin(), average.begin() + std::max(count, 0));
}

json memory() {
  struct sysinfo info {};
  if (sysinfo(&info) != 0) return json::object();
  const auto bytes = [&](unsigned long units) { return static_cast<std::uint64_t>(units) * info.mem_unit; };
  return {{"total_bytes", bytes(info.totalram)}, {"free_bytes", bytes(info.freeram)}};
}

json kernel() {
  struct utsname name {};
  if (uname(&name) != 0) return json::object();
  return {{"system", name.sysname}, {"release", name.release}, {"machine", name.machine}};
}

json locale() {
  const char* numbers = std::setlocale(LC_NUMERIC, nullptr);
  const char* zone = std::getenv("TZ");
  return {{"numeric", numbers != nullptr ? numbers : ""}, {"time_zone", zone != nullptr ? zone : ""}};
}

json floating_point() {
  json state = {{"rounding", std::fegetround() == FE_TONEAREST ? "nearest" : "not nearest"}};
#if defined(__x86_64__)
  const unsigned control = _mm_getcsr();
  state["flush_to_zero"] = (control & 0x8000U) != 0U;
  state["denormals_are_zero"] = (control & 0x0040U) != 0U;
#endif
  return state;
}

json libraries() {
  return {{"glibc", gnu_get_libc_version()},
          {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
          {"fmt", fmt::format("{}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100)},
          {"nlohmann_json", fmt::format("{}.{}.{}", NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR,
                                        NLOHMANN_JSON_VERSION_PATCH)},
          {"sqlite", sqlite3_libversion()}};
}

// The environment variables that set threads or duet's own switches; the others are private.
json variables() {
  constexpr std::array<std::string_view, 7> kPrefixes = {
      "DUET_", "OMP_", "TBB_", "OPENBLAS_", "MKL_", "GLIBC_TUNABLES", "SLURM_ARRAY_TASK_"};
  json values = json::object();
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) {
    const std::string_view text(*entry);
    const std::size_t equals = text.find('=');
    if (equals == std::string_view::npos) continue;
    for (const std::string_view prefix : kPrefixes) {
      if (text.starts_with(prefix)) {
        values[std::string(text.substr(0, equals))] = without_home(text.substr(equals + 1));
      }
    }
  }
  return values;
}

}  // namespace

nlohmann::json capture_environment() {
  return {{"schema", "duet.environment/1"},
          {"machine", describe_machine()},
          {"build", build()},
          {"processor", processor()},
          {"load_average", load()},
          {"memory", memory()},
          {"kernel", kernel()},
          {"locale", locale()},
          {"floating_point", floating_point()},
          {"libraries", libraries()},
          {"random_numbers", "philox4x32-10"},
          {"variables", variables()}};
}

std::string describe_machine() {
  const int cores = usable_cores();
  return fmt::format("{}, {} core{}, {}, {}, {}", processor_model(), cores, cores == 1 ? "" : "s", widest_vectors(),
                     build_info::kCompiler, build_info::kBuildType);
}

}  // namespace duet
