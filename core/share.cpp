#include "core/share.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdlib>
#include <filesystem>

#include "core/require.h"

namespace duet {

std::string share_file(std::string_view what, std::string_view relative) {
  namespace fs = std::filesystem;
  std::vector<std::string> places;
  if (const char* share = std::getenv("DUET_SHARE"); share != nullptr && *share != '\0')
    places.push_back((fs::path(share) / relative).string());
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  if (!program.empty())
    places.push_back((program.parent_path() / ".." / "share" / "duet" / relative).lexically_normal().string());
  places.push_back((fs::path(DUET_SOURCE_DIR) / relative).string());
  return first_existing(what, places);
}

std::string first_existing(std::string_view what, const std::vector<std::string>& places) {
  std::error_code ignored;
  for (const std::string& place : places)
    if (std::filesystem::exists(place, ignored)) return place;
  throw MissingError(fmt::format("no {}: looked at {}", what, fmt::join(places, ", ")));
}

}  // namespace duet
