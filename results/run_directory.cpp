#include "results/run_directory.h"

#include <fmt/format.h>

#include <filesystem>
#include <string_view>
#include <system_error>
#include <unordered_map>

#include "core/require.h"
#include "results/json_fields.h"
#include "results/published.h"

namespace duet {
namespace {

constexpr std::string_view kRunSchema = "duet.run/1";

std::string beside(const std::string& folder, const char* name) {
  return (std::filesystem::path(folder) / name).string();
}

// Text that reached us from elsewhere (a file name, an engine's message) may be no valid UTF-8; the row still counts.
std::string dump(const nlohmann::json& json, int indent = -1) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

nlohmann::json to_json(const RunInfo& info) {
  nlohmann::json json = {{"schema", kRunSchema},          {"suite", info.suite}, {"suite_version", info.suite_version},
                         {"suite_hash", info.suite_hash}, {"argv", info.argv},   {"created_at", info.created_at}};
  if (!info.certificate.is_null()) json["certificate"] = info.certificate;
  return json;
}

nlohmann::json read_certificate(const nlohmann::json& json, JsonFields& fields, const std::string& path) {
  if (!json.contains("certificate")) return nullptr;
  const nlohmann::json& certificate = fields.at("certificate");
  if (certificate.is_object()) return certificate;
  throw InputError(fmt::format("{}: key 'certificate': expected an object, found {}", path, certificate.type_name()));
}

std::vector<std::string> read_argv(JsonFields& fields, const std::string& path) {
  const nlohmann::json& json = fields.at("argv");
  std::vector<std::string> argv;
  if (!json.is_array()) throw InputError(fmt::format("{}: key 'argv': expected a list", path));
  for (const nlohmann::json& word : json) {
    if (!word.is_string()) throw InputError(fmt::format("{}: key 'argv': expected strings", path));
    argv.push_back(word.get<std::string>());
  }
  return argv;
}

// run.json alone: which suite the folder is of.
RunInfo read_identity(const std::string& folder) {
  const std::string path = beside(folder, "run.json");
  const nlohmann::json json = parse_json(read_file(path), path);
  JsonFields fields(json, path);
  if (const std::string schema = fields.text("schema"); schema != kRunSchema) {
    throw InputError(fmt::format("{}: expected schema {}, found {}", path, kRunSchema, schema));
  }
  RunInfo info;
  info.suite = fields.text("suite");
  info.suite_version = fields.text("suite_version");
  info.suite_hash = fields.text("suite_hash");
  info.argv = read_argv(fields, path);
  info.created_at = fields.text("created_at");
  info.certificate = read_certificate(json, fields, path);
  fields.refuse_unknown();
  return info;
}

std::string suite_name(const std::string& suite, const std::string& version, const std::string& hash) {
  return fmt::format("{}@{} ({})", suite, version, hash.substr(0, 12));
}

std::string suite_name(const RunInfo& info) { return suite_name(info.suite, info.suite_version, info.suite_hash); }

bool is_run(const std::string& folder) { return std::filesystem::exists(beside(folder, "run.json")); }

// A run that was killed while run.json was written leaves only the half-written file of another name.
bool is_fresh(const std::string& folder) {
  std::error_code error;
  if (!std::filesystem::exists(folder, error)) return true;
  std::filesystem::directory_iterator entries(folder, error);
  if (error) throw InputError(fmt::format("cannot open '{}' as a run directory: {}", folder, error.message()));
  for (const auto& entry : entries) {
    if (!entry.path().filename().string().starts_with("run.json.")) return false;
  }
  return true;
}

void create(const std::string& folder, const RunInfo& info) {
  if (!is_fresh(folder)) {
    throw InputError(fmt::format("'{}' is not empty and holds no run (no run.json): choose another folder", folder));
  }
  write_file(beside(folder, "run.json"), dump(to_json(info), 2) + "\n");
}

void require_same_suite(const std::string& folder, const RunInfo& found, const RunInfo& wanted) {
  if (found.suite == wanted.suite && found.suite_version == wanted.suite_version &&
      found.suite_hash == wanted.suite_hash) {
    return;
  }
  throw InputError(fmt::format("'{}' holds a run of suite {}, not of {}: choose another folder", folder,
                               suite_name(found), suite_name(wanted)));
}

// Another machine or another program may go on with a run; who wrote which row is then told by the times.
void record_resumption(const std::string& folder, const RunInfo& info) {
  nlohmann::json json = {{"at", info.created_at}, {"argv", info.argv}, {"environment", info.environment}};
  if (!info.certificate.is_null()) json["certificate"] = info.certificate;
  LineAppender(beside(folder, "resumed.jsonl")).append(dump(json));
}

EpisodeRow parse_row(std::string_view line, const std::string& where, const RunInfo& info) {
  EpisodeRow row = [&] {
    try {
      return row_from_json(parse_json(line, "episode row"));
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", where, error.what()));
    }
  }();
  if (row.suite_hash != info.suite_hash) {
    throw InputError(fmt::format("{}: the row is of suite {}, the run of {}", where,
                                 suite_name(row.suite, row.suite_version, row.suite_hash), suite_name(info)));
  }
  return row;
}

struct Rows {
  std::vector<EpisodeRow> rows;
  std::unordered_map<std::string, int> line_of_key;
  int dropped_lines = 0;
};

Rows read_rows(const std::string& folder, const RunInfo& info) {
  Rows result;
  const std::string path = beside(folder, "episodes.jsonl");
  if (!std::filesystem::exists(path)) return result;
  const std::string text = read_file(path);
  int line = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string::npos) {
      ++result.dropped_lines;
      break;
    }
    const std::string where = fmt::format("{}:{}", path, ++line);
    EpisodeRow row = parse_row(std::string_view(text).substr(begin, end - begin), where, info);
    const auto [first, is_new] = result.line_of_key.try_emplace(row.key, line);
    if (!is_new) throw InputError(fmt::format("{}: the key {} is already in line {}", where, row.key, first->second));
    result.rows.push_back(std::move(row));
    begin = end + 1;
  }
  return result;
}

}  // namespace

RunDirectory RunDirectory::open(const std::string& path, const RunInfo& info) {
  if (is_published(path))
    throw InputError(fmt::format("'{}' is published: its rows stay as they are; choose another folder", path));
  const bool resumed = is_run(path);
  if (!resumed) create(path, info);
  require_same_suite(path, read_identity(path), info);
  // Also where a run was killed between the first file and these.
  if (const std::string file = beside(path, "env.json"); !std::filesystem::exists(file)) {
    write_file(file, dump(info.environment, 2) + "\n");
  }
  if (const std::string file = beside(path, "suite.yaml"); !std::filesystem::exists(file)) {
    write_file(file, info.suite_yaml);
  }
  RunDirectory run;
  run.path_ = path;
  // Opening cuts an incomplete last line off, so that what is read after it is what the file holds.
  run.lines_ = std::make_unique<LineAppender>(beside(path, "episodes.jsonl"));
  for (const auto& [key, line] : read_rows(path, info).line_of_key) run.keys_.insert(key);
  run.suite_hash_ = info.suite_hash;
  if (resumed) record_resumption(path, info);
  return run;
}

void RunDirectory::append(const EpisodeRow& row) {
  require(!row.key.empty(), "an episode row without a key");
  require(!has(row.key), fmt::format("the episode {} is already in '{}'", row.key, path_));
  require(row.suite_hash == suite_hash_, fmt::format("a row of suite hash {} does not belong in '{}' (suite hash {})",
                                                     row.suite_hash, path_, suite_hash_));
  lines_->append(dump(duet::to_json(row)));
  keys_.insert(row.key);
}

Run load_run(const std::string& path) {
  if (!is_run(path)) throw InputError(fmt::format("'{}' is not a run directory (no run.json)", path));
  check_published(path);
  Run run;
  run.info = read_identity(path);
  const std::string environment = beside(path, "env.json");
  run.info.environment = parse_json(read_file(environment), environment);
  run.info.suite_yaml = read_file(beside(path, "suite.yaml"));
  Rows rows = read_rows(path, run.info);
  run.rows = std::move(rows.rows);
  run.dropped_lines = rows.dropped_lines;
  return run;
}

}  // namespace duet
