#include "duet/rows/folder/run_litter.h"

#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <filesystem>
#include <string_view>
#include <system_error>

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMark = ".part-";

bool is_alive(pid_t process) { return ::kill(process, 0) == 0 || errno != ESRCH; }

// The process that wrote a half-written file; 0 for any other name.
pid_t writer_of(std::string_view name) {
  const std::size_t mark = name.rfind(kMark);
  if (mark == std::string_view::npos) return 0;
  name.remove_prefix(mark + kMark.size());
  pid_t process = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), process);
  return error == std::errc() && process > 0 ? process : 0;
}

void remove_from(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(folder, error))) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const pid_t writer = writer_of(entry.path().filename().string());
    if (writer != 0 && !is_alive(writer)) fs::remove(entry.path(), error);
  }
}

}  // namespace

void remove_litter(const std::string& folder) {
  for (const char* name : {".", "trajectories", "prepared"}) remove_from(fs::path(folder) / name);
}

}  // namespace duet
