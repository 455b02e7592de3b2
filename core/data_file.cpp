#include "duet/core/data_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "duet/core/no_data.h"
#include "duet/core/text.h"

namespace duet {
namespace {

void refuse_empty(const std::string& path, const std::string& bytes) {
  if (bytes.empty()) throw InputError(fmt::format("'{}': the file is empty", shown(path, kShownSentence)));
}

}  // namespace

std::string read_data(const std::string& path, std::int64_t most) {
  std::string bytes = read_file(path, most);
  refuse_empty(path, bytes);
  return bytes;
}

std::string read_plain_text(const std::string& path, std::int64_t most) { return plain_text(read_data(path, most)); }

std::string read_head(const std::string& path, std::size_t most) {
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw InputError(
        fmt::format("cannot read '{}': {}", shown(path, kShownSentence), std::generic_category().message(errno)));
  std::string bytes(most, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(most));
  bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return bytes;
}

void require_data(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return;
  const std::string head = read_head(path, kToldBytes);
  refuse_empty(path, head);
  refuse_no_data(path, head);
}

}  // namespace duet
