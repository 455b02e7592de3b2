#include "duet/core/build_tree.h"

#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <string_view>

namespace duet {
namespace {

namespace fs = std::filesystem;

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

}  // namespace duet
