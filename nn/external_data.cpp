#include "duet/nn/external_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "duet/core/data_file.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

bool climbs(const fs::path& path) {
  return std::any_of(path.begin(), path.end(), [](const fs::path& part) { return part == ".."; });
}

// Links followed, as far as the path exists.
bool is_below(const fs::path& folder, const fs::path& file) {
  std::error_code error;
  const fs::path top = fs::weakly_canonical(folder, error), found = fs::weakly_canonical(file, error);
  return !error && std::mismatch(top.begin(), top.end(), found.begin(), found.end()).first == top.end();
}

}  // namespace

std::string location_fault(const std::string& folder, const std::string& location) {
  const fs::path path(location);
  if (location.empty() || location.find('\0') != std::string::npos || path.is_absolute() || climbs(path))
    return fmt::format("expected external data at a path below the model's folder, found '{}'", shown(location));
  const fs::path file = fs::path(folder) / path;
  if (!is_below(folder, file))
    return fmt::format("expected external data in the model's folder, found that '{}' leads out of it",
                       shown(location));
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored))
    return fmt::format("expected external data in the file '{}', found none", shown(file.string()));
  return "";
}

std::string ExternalData::read(const ExternalPlace& place, const std::string& where) {
  const auto refuse = [&](const std::string& problem) {
    throw InputError(fmt::format("{}: {}", where, shown(problem, kShownSentence)));
  };
  if (const std::string fault = location_fault(folder_, place.location); !fault.empty()) refuse(fault);
  auto found = files_.find(place.location);
  if (found == files_.end())
    found = files_.emplace(place.location, read_file((fs::path(folder_) / place.location).string())).first;
  const std::string& bytes = found->second;
  const auto size = static_cast<std::int64_t>(bytes.size());
  const std::int64_t length = place.length.value_or(size - std::min(size, place.offset));
  if (place.offset > size || length > size - place.offset) {
    require_data((fs::path(folder_) / place.location).string());
    refuse(fmt::format("expected {} bytes from {} on in '{}', found a file of {} (truncated?)", length, place.offset,
                       place.location, size));
  }
  if (length > kMostExternalBytes)
    refuse(fmt::format("expected at most {} bytes in '{}', found {}", kMostExternalBytes, place.location, length));
  return bytes.substr(static_cast<std::size_t>(place.offset), static_cast<std::size_t>(length));
}

}  // namespace duet
