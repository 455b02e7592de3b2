#include "duet/experiment/plan/prepared_clips.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <filesystem>
#include <system_error>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/core/version.h"

namespace duet {

std::string PreparedClips::name_of(const std::string& source) const {
  return fmt::format("prepared/{:.32}.npz", sha256_hex(fmt::format("{}\n{}", made_by_, source)));
}

std::optional<PairedMotion> PreparedClips::find(const std::string& source) const {
  if (!keeps()) return std::nullopt;
  const std::string path = (std::filesystem::path(folder_) / name_of(source)).string();
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return std::nullopt;
  try {
    return load_paired_motion(path);
  } catch (const InputError&) {
    return std::nullopt;  // damaged: made anew
  }
}

void PreparedClips::keep(const std::string& source, const PairedMotion& clip) const {
  try {
    if (keeps()) save_paired_motion(clip, inside(folder_, name_of(source)));
  } catch (const StorageError&) {
    return;  // it saves time, nothing else: where the disk is full, the first row says so
  }
}

void remove_prepared_clips(const std::string& folder) {
  namespace fs = std::filesystem;
  const fs::path prepared = fs::path(folder) / "prepared";
  std::error_code ignored;
  if (!fs::is_directory(fs::symlink_status(prepared, ignored))) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(prepared, ignored)) {
    const fs::path name = entry.path().filename();
    const std::string digest = name.stem().string();
    const bool is_digest = digest.size() == 32 && digest.find_first_not_of("0123456789abcdef") == std::string::npos;
    if (is_digest && name.extension() == ".npz") fs::remove(entry.path(), ignored);
  }
  fs::remove(prepared, ignored);  // where nobody has put anything else into it
}

std::string program_identity() {
  struct stat program {};
  if (::stat(program_file().c_str(), &program) != 0) return duet_version();
  return fmt::format("{} {} {}.{:09}", duet_version(), program.st_size, program.st_mtim.tv_sec,
                     program.st_mtim.tv_nsec);
}

}  // namespace duet
