#include "duet/rows/folder/published.h"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/scratch_folder.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/folder/run_files.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRows = "episodes.jsonl";
constexpr std::array kFiles = {"run.json", "env.json", "suite.yaml", "resumed.jsonl"};  // where they are

std::string in(const std::string& folder, const std::string& name) { return (fs::path(folder) / name).string(); }

std::string lean_rows(const Run& run) {
  std::string text;
  for (EpisodeRow row : run.rows) {
    for (const RowField& field : row_fields())
      if (field.use.heavy) std::visit([&](auto member) { row.*member = {}; }, field.json.member);
    text += dumped(to_json(row)) + "\n";
  }
  return text;
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

nlohmann::json description_of(const Run& run) {
  nlohmann::json without = nlohmann::json::array();
  for (const RowField& field : row_fields())
    if (field.use.heavy) without.push_back(field.json.name);
  return {{"suite", run.info.suite},
          {"suite_version", run.info.suite_version},
          {"suite_hash", run.info.suite_hash},
          {"rows", run.rows.size()},
          {"without", without}};
}

void copy_inputs(const std::string& source, const std::string& folder, const PublishedInputs& inputs) {
  for (const std::string& name : inputs.files) {
    require_plain_file(source, name);
    fs::create_directories(fs::path(in(folder, name)).parent_path());
    fs::copy_file(in(source, name), in(folder, name));
  }
  for (const auto& [name, text] : inputs.texts) write_file(in(folder, name), text);
}

void fill(const std::string& folder, const std::string& source, const Run& run, const PublishedInputs& inputs) {
  write_file(in(folder, kRows), lean_rows(run));
  for (const char* name : kFiles)
    if (fs::exists(in(source, name))) write_file(in(folder, name), without_places(read_file(in(source, name))));
  copy_inputs(source, folder, inputs);
  write_manifest(folder, description_of(run));
}

}  // namespace

void publish_run(const std::string& run, const std::string& folder, const PublishedInputs& inputs) {
  if (fs::exists(folder))
    throw InputError(fmt::format("'{}' is there already: what is published stays; choose another folder", folder));
  const Run loaded = load_run(run);
  if (loaded.rows.empty()) throw InputError(fmt::format("'{}' has no rows to publish", run));
  const ScratchFolder scratch = ScratchFolder::beside(folder);
  fill(scratch / "run", run, loaded, inputs);
  scratch.publish("run", folder);
}

}  // namespace duet
