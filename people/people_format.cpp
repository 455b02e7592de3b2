#include "duet/people/people_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <system_error>

#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 2'000'000;

// Calls `take` for the wanted files below a folder until it says no.
void visit_files(const std::string& folder, const std::function<bool(const std::string& name)>& wanted,
                 const std::function<bool(const std::string& path)>& take, std::error_code& error) {
  fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    if (!entry->is_regular_file(ignored) || !wanted(entry->path().filename().string())) continue;
    if (!take(entry->path().string())) return;
  }
}

// "a/b/c.npz" of a file below a folder -> "a-b-c": names of clips stand in file names.
std::string id_below(const std::string& path, const std::string& folder) {
  std::string id = fs::path(path).lexically_relative(folder).replace_extension().generic_string();
  if (id.empty() || id == ".") id = file_stem(path);
  std::replace(id.begin(), id.end(), '/', '-');
  return id;
}

}  // namespace

std::vector<std::string> files_at(const std::string& path, const std::function<bool(const std::string& name)>& wanted) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw InputError(fmt::format("cannot read '{}': no such file or folder", excerpt(path)));
  if (!fs::is_directory(status) && !wanted(fs::path(path).filename().string()))
    throw InputError(fmt::format("'{}': expected a folder, or a file of the format's name", excerpt(path)));
  if (!fs::is_directory(status)) return {path};
  std::vector<std::string> files;
  visit_files(
      path, wanted, [&](const std::string& file) { return files.push_back(file), files.size() < kMostFiles; }, error);
  if (error) throw InputError(fmt::format("cannot read '{}': {}", excerpt(path), error.message()));
  std::sort(files.begin(), files.end());
  return files;
}

std::string first_file_at(const std::string& path, const std::function<bool(const std::string& name)>& wanted) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) return "";
  if (!fs::is_directory(status)) return wanted(fs::path(path).filename().string()) ? path : "";
  std::string first;
  visit_files(
      path, wanted, [&](const std::string& file) { return first = file, false; }, error);
  return first;
}

std::string leading_bytes(const std::string& path, std::size_t count) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return "";
  try {
    return read_head(path, count);
  } catch (const InputError&) {
    return "";
  }
}

std::string file_stem(const std::string& path) { return fs::path(path).stem().string(); }

std::vector<ClipPlace> pairs_at(std::span<const std::string> paths,
                                const std::function<bool(const std::string& name)>& wanted, std::string_view format) {
  if (paths.size() != 2)
    throw InputError(fmt::format("{}: expected two paths, one per person, found {}", format, paths.size()));
  const bool folder_a = fs::is_directory(paths[0]), folder_b = fs::is_directory(paths[1]);
  if (folder_a != folder_b)
    throw InputError(fmt::format("'{}', '{}': expected two files or two folders, found one of each", excerpt(paths[0]),
                                 excerpt(paths[1])));
  const std::vector<std::string> a = files_at(paths[0], wanted), b = files_at(paths[1], wanted);
  if (!folder_a) return {{.id = file_stem(a[0]) + "-" + file_stem(b[0]), .files = {a[0], b[0]}, .entry = ""}};
  std::map<std::string, std::string> of_b;
  for (const std::string& file : b) of_b[id_below(file, paths[1])] = file;
  std::vector<ClipPlace> clips;
  for (const std::string& file : a) {
    const std::string id = id_below(file, paths[0]);
    if (const auto other = of_b.find(id); other != of_b.end())
      clips.push_back({.id = id, .files = {file, other->second}, .entry = ""});
  }
  if (clips.empty())
    throw InputError(
        fmt::format("'{}', '{}': no two files of the same name in both folders", excerpt(paths[0]), excerpt(paths[1])));
  return clips;
}

std::vector<ClipPlace> clips_at(std::span<const std::string> paths,
                                const std::function<bool(const std::string& name)>& wanted, std::string_view format) {
  std::vector<ClipPlace> clips;
  for (const std::string& path : paths)
    for (const std::string& file : files_at(path, wanted))
      clips.push_back({.id = id_below(file, fs::is_directory(path) ? path : ""), .files = {file}, .entry = ""});
  if (clips.empty())
    throw InputError(fmt::format("'{}': no file of {} found", paths.empty() ? "" : excerpt(paths[0]), format));
  return clips;
}

bool both_are(std::span<const std::string> paths, const std::function<bool(const std::string& name)>& wanted,
              const std::function<bool(const std::string& path)>& is_one) {
  return paths.size() == 2 && std::all_of(paths.begin(), paths.end(), [&](const std::string& path) {
           const std::string file = first_file_at(path, wanted);
           return !file.empty() && is_one(file);
         });
}

}  // namespace duet
