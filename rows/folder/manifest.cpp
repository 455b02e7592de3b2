#include "duet/rows/folder/manifest.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/rows/folder/run_files.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr const char* kPublishedSchema = "duet.published/1";
constexpr const char* kManifest = "manifest.json";
constexpr const char* kPublishedRows = "episodes.jsonl";

std::string file_of(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder) / name).string();
}

// A path that leads nowhere but below the folder.
bool stays_below(const std::filesystem::path& path) {
  return !path.empty() && path.is_relative() && std::ranges::find(path, std::filesystem::path("..")) == path.end();
}

}  // namespace

void write_manifest(const std::string& folder, nlohmann::json about) {
  nlohmann::json files = nlohmann::json::object();
  for (const std::filesystem::directory_entry& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      files[entry.path().lexically_relative(folder).generic_string()] = sha256_file(entry.path().string());
  about["schema"] = kPublishedSchema;
  about["files"] = std::move(files);
  write_file(file_of(folder, kManifest), dumped(about, 2) + "\n");
}

bool is_published(const std::string& folder) { return std::filesystem::exists(file_of(folder, kManifest)); }

void check_published(const std::string& folder) {
  if (!is_published(folder)) return;
  const std::string path = file_of(folder, kManifest);
  const nlohmann::json json = parse_json(read_text(path), path);
  JsonFields fields(json, path);
  if (const std::string schema = fields.text("schema"); schema != kPublishedSchema)
    throw InputError(fmt::format("{}: expected schema {}, found {}", path, kPublishedSchema, shown(schema)));
  const nlohmann::json& files = fields.at("files");
  if (!files.is_object() || !files.contains(kPublishedRows))
    throw InputError(fmt::format("{}: key 'files': expected the SHA-256 of {} and others", path, kPublishedRows));
  for (const auto& [name, digest] : files.items()) {
    if (!stays_below(name))
      throw InputError(
          fmt::format("{}: key 'files': expected names of files in the folder, found '{}'", path, shown(name)));
    require_plain_file(folder, name);
    const std::string found = sha256_file(file_of(folder, name));
    if (digest != found)
      throw InputError(fmt::format("{}: SHA-256 expected {}, found {}: not what was published", file_of(folder, name),
                                   shown(dumped(digest)), found));
  }
}

}  // namespace duet
