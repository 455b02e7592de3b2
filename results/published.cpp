#include "results/published.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/digest.h"
#include "core/file.h"
#include "core/require.h"
#include "core/text.h"
#include "results/json_fields.h"
#include "results/run_directory.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSchema = "duet.published/1";
constexpr const char* kManifest = "manifest.json";
constexpr const char* kRows = "episodes.jsonl";
constexpr const char* kInputs = "inputs";  // what the run was made from, where it keeps it
constexpr std::array kFiles = {"run.json", "env.json", "suite.yaml", "resumed.jsonl"};  // where they are

std::string in(const std::string& folder, const std::string& name) { return (fs::path(folder) / name).string(); }

std::string lean_rows(const Run& run) {
  std::string text;
  for (EpisodeRow row : run.rows) {
    row.trace = {};
    row.feet = {};
    text += dumped(to_json(row)) + "\n";
  }
  return text;
}

// A path that leads nowhere but below the folder.
bool stays_below(const fs::path& path) {
  return !path.empty() && path.is_relative() && std::ranges::find(path, fs::path("..")) == path.end();
}

// A run names files by their places on its machine; what is published names them from the folder that it is published
// from.
std::string without_places(std::string text) {
  for (std::size_t at = 0; (at = text.find("\"/", at)) != std::string::npos;) {
    const std::size_t begin = at + 1, end = text.find('"', begin);
    if (end == std::string::npos) break;
    const fs::path place = text.substr(begin, end - begin);
    const std::string from_here = place.lexically_proximate(fs::current_path()).string();
    text.replace(begin, place.string().size(), from_here);
    at = begin + from_here.size() + 1;
  }
  return text;
}

// Everything but the manifest is in `folder` by now.
nlohmann::json manifest_of(const Run& run, const std::string& folder) {
  nlohmann::json files = nlohmann::json::object();
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      files[entry.path().lexically_relative(folder).generic_string()] = sha256_file(entry.path().string());
  return {{"schema", kSchema},
          {"suite", run.info.suite},
          {"suite_version", run.info.suite_version},
          {"suite_hash", run.info.suite_hash},
          {"rows", run.rows.size()},
          {"without", {"trace", "feet"}},
          {"files", files}};
}

void fill(const std::string& folder, const std::string& source, const Run& run) {
  write_file(in(folder, kRows), lean_rows(run));
  for (const char* name : kFiles)
    if (fs::exists(in(source, name))) write_file(in(folder, name), without_places(read_file(in(source, name))));
  if (const std::string inputs = in(source, kInputs); fs::exists(inputs))
    fs::copy(inputs, in(folder, kInputs), fs::copy_options::recursive);
  write_file(in(folder, kManifest), manifest_of(run, folder).dump(2) + "\n");
}

}  // namespace

void publish_run(const std::string& run, const std::string& folder) {
  if (fs::exists(folder))
    throw InputError(fmt::format("'{}' is there already: what is published stays; choose another folder", folder));
  const Run loaded = load_run(run);
  if (loaded.rows.empty()) throw InputError(fmt::format("'{}' has no rows to publish", run));
  const std::string partial = fs::path(folder).lexically_normal().string() + ".partial";
  fs::remove_all(partial);
  try {
    fill(partial, run, loaded);
    fs::rename(partial, folder);
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(partial, ignored);
    throw;
  }
}

bool is_published(const std::string& folder) { return fs::exists(in(folder, kManifest)); }

void check_published(const std::string& folder) {
  if (!is_published(folder)) return;
  const std::string path = in(folder, kManifest);
  const nlohmann::json json = parse_json(read_text(path), path);
  JsonFields fields(json, path);
  if (const std::string schema = fields.text("schema"); schema != kSchema)
    throw InputError(fmt::format("{}: expected schema {}, found {}", path, kSchema, shown(schema)));
  const nlohmann::json& files = fields.at("files");
  if (!files.is_object() || !files.contains(kRows))
    throw InputError(fmt::format("{}: key 'files': expected the SHA-256 of {} and others", path, kRows));
  for (const auto& [name, digest] : files.items()) {
    if (!stays_below(name))
      throw InputError(
          fmt::format("{}: key 'files': expected names of files in the folder, found '{}'", path, shown(name)));
    const std::string found = sha256_file(in(folder, name));
    if (digest != found)
      throw InputError(fmt::format("{}: SHA-256 expected {}, found {}: not what was published", in(folder, name),
                                   shown(digest.dump()), found));
  }
}

}  // namespace duet
