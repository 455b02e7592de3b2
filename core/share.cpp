#include "duet/core/share.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "duet/core/require.h"

// Defined by a program that was linked against an installed duet (cmake/duet_location.cpp.in), absent elsewhere.
extern "C" const char* duet_installed_prefix() __attribute__((weak));
// Defined in a module that another program loads (python/module.cpp), absent elsewhere.
extern "C" const char* duet_module_file() __attribute__((weak));

namespace duet {

namespace fs = std::filesystem;

std::vector<std::string> installed_prefixes() {
  std::vector<std::string> prefixes;
  std::error_code ignored;
  if (duet_module_file != nullptr) prefixes.push_back(fs::path(duet_module_file()).parent_path().string());
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  if (!program.empty()) prefixes.push_back((program.parent_path() / "..").lexically_normal().string());
  if (duet_installed_prefix != nullptr) prefixes.emplace_back(duet_installed_prefix());
  return prefixes;
}

std::string program_file() { return duet_module_file != nullptr ? duet_module_file() : "/proc/self/exe"; }

std::vector<std::string> share_folders() {
  std::vector<std::string> folders;
  if (const char* share = std::getenv("DUET_SHARE"); share != nullptr && *share != '\0') folders.emplace_back(share);
  bool is_installed = false;
  std::error_code error;
  for (const std::string& prefix : installed_prefixes()) {
    const fs::path folder = fs::path(prefix) / "share" / "duet";
    is_installed = is_installed || (fs::is_directory(folder, error) && !fs::is_empty(folder, error));
    folders.push_back(folder.string());
  }
  static const std::optional<BuildTree> built_in = build_tree_of(program_file());
  if (!is_installed && built_in) folders.push_back(built_in->sources);
  return folders;
}

std::string share_file(std::string_view what, std::string_view relative) {
  std::vector<std::string> places;
  for (const std::string& folder : share_folders()) places.push_back((fs::path(folder) / relative).string());
  return first_existing(what, places);
}

std::vector<std::string> published_places(const std::string& folder, const std::string& name) {
  const auto setting = [](const char* variable) {
    const char* value = std::getenv(variable);
    return fs::path(value == nullptr ? "" : value);
  };
  std::vector<std::string> places = {(fs::path(folder) / name).string()};
  if (const fs::path models = setting("DUET_MODELS"); !models.empty()) places.push_back((models / name).string());
  if (const fs::path shared = setting("DUET_SHARED"); !shared.empty())
    for (const char* part : {"models", "arena"}) places.push_back((shared / part / name).string());
  return places;
}

std::string first_existing(std::string_view what, const std::vector<std::string>& places) {
  std::error_code ignored;
  for (const std::string& place : places)
    if (fs::exists(place, ignored)) return place;
  throw MissingError(fmt::format("no {}: looked at {}", what, fmt::join(places, ", ")));
}

namespace {

// Lines that CMake writes of the project `duet`, also where it is a part of another.
constexpr std::string_view kSources = "duet_SOURCE_DIR:STATIC=", kBuild = "duet_BINARY_DIR:STATIC=";

// A cache of somebody else, in a folder above the program, says nothing.
bool of_one_owner(const fs::path& a, const fs::path& b) {
  struct stat of_a = {}, of_b = {};
  return ::stat(a.c_str(), &of_a) == 0 && ::stat(b.c_str(), &of_b) == 0 && of_a.st_uid == of_b.st_uid;
}

BuildTree tree_in(const fs::path& cache) {
  BuildTree tree;
  std::ifstream file(cache);
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(kSources)) tree.sources = line.substr(kSources.size());
    if (line.starts_with(kBuild)) tree.build = line.substr(kBuild.size());
  }
  return tree;
}

}  // namespace

std::optional<BuildTree> build_tree_of(const std::string& program) {
  std::error_code ignored;
  const fs::path file = fs::canonical(program, ignored);
  for (fs::path folder = file.parent_path(); folder.has_relative_path(); folder = folder.parent_path()) {
    const fs::path cache = folder / "CMakeCache.txt";
    if (!fs::is_regular_file(cache, ignored)) continue;
    const BuildTree tree = of_one_owner(file, cache) ? tree_in(cache) : BuildTree();
    if (tree.sources.empty() || tree.build.empty()) return std::nullopt;
    return tree;
  }
  return std::nullopt;
}

const char* duet_version() { return DUET_VERSION; }

}  // namespace duet
