#include "duet/bench/shipped_suites.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "duet/bench/episode.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/share.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

std::string path_of(const std::string& name) {
  return share_file(fmt::format("suite '{}'", name), fmt::format("suites/{}.yaml", name));
}

// The comment lines that begin the file, in one.
std::string head_comment(const std::string& yaml) {
  std::istringstream lines(yaml);
  std::string comment;
  for (std::string line; std::getline(lines, line) && line.starts_with("# ");)
    comment += (comment.empty() ? "" : " ") + line.substr(2);
  return comment;
}

}  // namespace

std::vector<std::string> shipped_suite_names() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(fs::path(path_of("demo")).parent_path()))
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  std::ranges::sort(names);
  return names;
}

ShippedSuite shipped_suite(const std::string& name) {
  const std::string file = path_of(name);
  const Suite suite = load_suite(file);
  return {name, fmt::format("{} {}", suite.name, suite.version), first_sentence(read_file(file)),
          count_episodes(suite, tasks_of_own_clips(suite), {RunPart()}), suite.clips.given};
}

std::string suite_file(const std::string& suite) {
  std::error_code ignored;
  const bool is_path = suite.ends_with(".yaml") || suite.find('/') != std::string::npos;
  if (is_path || (fs::exists(suite, ignored) && !fs::is_directory(suite, ignored))) return suite;
  const std::vector<std::string> names = shipped_suite_names();
  if (std::ranges::find(names, suite) == names.end())
    throw std::invalid_argument(unknown_name_message("suite", suite, names) + "; or the path of a file");
  return path_of(suite);
}

std::string first_sentence(const std::string& yaml) {
  std::string comment = head_comment(yaml);
  for (std::size_t i = 0; i < comment.size(); ++i) {
    const bool ends = comment[i] == '.' || comment[i] == '?';
    if (ends && (i + 1 == comment.size() || comment[i + 1] == ' ')) return comment.substr(0, i + 1);
  }
  return comment;
}

}  // namespace duet
