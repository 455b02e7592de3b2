#include "duet/rows/folder/run_files.h"

#include <fmt/format.h>

#include <array>
#include <filesystem>

#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr std::array kRunFiles = {"run.json", "env.json",      "suite.yaml", "episodes.jsonl", "resumed.jsonl",
                                  "lock",     "manifest.json", "hosts.json", "plan.json",      "decision.json"};
constexpr std::array kRunFolders = {"inputs", "trajectories", "prepared", "clips", "attempts", "slurm", "trainings"};

// A name that is gone by now is no fault: others may work in the folder.
void require_plain(const fs::path& path, const fs::file_status& status) {
  using Type = fs::file_type;
  const Type type = status.type();
  if (type == Type::regular || type == Type::directory || type == Type::not_found || type == Type::none) return;
  throw InputError(fmt::format(
      "'{}' is {}: expected a file or a folder of the run's own", shown(path.string(), 400),
      type == Type::symlink ? "a symbolic link, which may lead out of the folder" : "a device, a pipe or a socket"));
}

void require_plain_below(const fs::path& folder) {
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code gone;
    require_plain(entry->path(), entry->symlink_status(gone));
  }
}

}  // namespace

void require_plain_file(const std::string& run, const std::string& name) {
  fs::path path = run;
  for (const fs::path& part : fs::path(name)) {
    path /= part;
    std::error_code error;
    require_plain(path, fs::symlink_status(path, error));
  }
}

void require_plain_files(const std::string& run) {
  for (const char* name : kRunFiles) require_plain_file(run, name);
  for (const char* name : kRunFolders) {
    require_plain_file(run, name);
    require_plain_below(fs::path(run) / name);
  }
}

}  // namespace duet
