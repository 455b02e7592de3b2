#include "duet/backends/node/node_engine.h"

#include <fmt/format.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "duet/backends/host/host_backend.h"
#include "duet/core/child_process.h"
#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/core/share.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr int kOldestNode = 18;  // the first whose WebAssembly and modules the packages load in

std::string text_of(const char* variable) {
  const char* const value = std::getenv(variable);
  return value == nullptr ? "" : value;
}

// The folders that may have node_modules, in their order: $DUET_HOSTS alone where it is set; where `./run setup` puts
// them in the tree that a program was built in; the user's.
std::vector<std::string> package_folders() {
  if (const std::string set = text_of("DUET_HOSTS"); !set.empty()) return {set};
  std::vector<std::string> folders;
  if (const std::optional<BuildTree> tree = build_tree_of(program_file()))
    folders.push_back((fs::path(tree->sources) / "build" / "hosts").string());
  const std::string data = text_of("XDG_DATA_HOME"), home = text_of("HOME");
  if (!data.empty() || !home.empty())
    folders.push_back(
        ((data.empty() ? fs::path(home) / ".local" / "share" : fs::path(data)) / "duet" / "hosts").string());
  return folders;
}

// The first folder that has the package, in whatever version.
std::optional<std::string> folder_of(const NodeEngine& engine) {
  std::error_code ignored;
  for (const std::string& folder : package_folders())
    if (fs::is_regular_file(fs::path(folder) / "node_modules" / engine.package / "package.json", ignored))
      return folder;
  return std::nullopt;
}

std::string how_to_install(const NodeEngine& engine) {
  return fmt::format("`./run setup --engines {}` installs it", engine.engine);
}

// The version in the package's package.json; throws InputError for a file that has none.
std::string installed_version(const std::string& folder, const NodeEngine& engine) {
  const std::string file = (fs::path(folder) / "node_modules" / engine.package / "package.json").string();
  const nlohmann::json package = parse_json(read_text(file), file);
  const auto version = package.find("version");
  if (version == package.end() || !version->is_string()) throw InputError(fmt::format("{}: no version", file));
  return version->get<std::string>();
}

// The line that `node --version` prints, "v20.20.2"; "" where it prints none.
std::string node_version(const std::string& node) {
  std::string command = "'";
  for (const char c : node) command += c == '\'' ? std::string("'\\''") : std::string(1, c);
  FILE* const pipe = popen((command + "' --version 2>/dev/null </dev/null").c_str(), "re");
  if (pipe == nullptr) return "";
  std::array<char, 64> line{};
  const std::string found = std::fgets(line.data(), line.size(), pipe) == nullptr ? "" : line.data();
  pclose(pipe);
  return std::string(trimmed(found, " \t\r\n"));
}

std::string fault_of_node() {
  std::string node;
  try {
    node = find_program("node", ".");
  } catch (const MissingError&) {
    return "Node.js is not there (Debian's package nodejs)";
  }
  const std::string version = node_version(node);
  const std::string_view major = version.empty() ? "" : std::string_view(version).substr(1, version.find('.') - 1);
  if (parse_number(major).value_or(0.0) < kOldestNode)
    return fmt::format("{} is Node.js '{}', expected {} or later", node, excerpt(version), kOldestNode);
  return "";
}

}  // namespace

std::string absence_of(const NodeEngine& engine) {
  const std::optional<std::string> folder = folder_of(engine);
  if (!folder)
    return fmt::format("the package {} {} of npm is not there: {}", engine.package, engine.package_version,
                       how_to_install(engine));
  try {
    const std::string found = installed_version(*folder, engine);
    if (found != engine.package_version)
      return fmt::format("{} has {} {}, expected {}: {}", *folder, engine.package, excerpt(found),
                         engine.package_version, how_to_install(engine));
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return fault_of_node();
}

std::unique_ptr<Backend> make_node_backend(const NodeEngine& engine, const Scene& scene,
                                           std::span<const EngineOption> options) {
  const std::optional<std::string> folder = folder_of(engine);
  if (!folder) throw MissingError(fmt::format("engine '{}' is absent: {}", engine.engine, absence_of(engine)));
  const std::string script = share_file("host of Node.js", "backends/node/host.mjs");
  return make_host_backend(scene,
                           {.engine = engine.engine,
                            .version = engine.engine_version,
                            .command = {"node", script, engine.engine, *folder},
                            .folder = fs::path(script).parent_path().string()},
                           options);
}

}  // namespace duet
