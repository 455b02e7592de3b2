#include "duet/motion/people/people_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <utility>

#include "duet/archives/npy/npy.h"
#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

// Letters alone, in lower case: data sets number their labels.
std::string letters(std::string_view label) {
  std::string text;
  for (const char c : label)
    if (std::isalpha(static_cast<unsigned char>(c)) != 0)
      text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

constexpr std::array<std::pair<std::string_view, std::string_view>, 24> kLabels = {{{"hugging", "hug"},
                                                                                    {"hugs", "hug"},
                                                                                    {"shakinghands", "handshake"},
                                                                                    {"shakehands", "handshake"},
                                                                                    {"shakehand", "handshake"},
                                                                                    {"handshakes", "handshake"},
                                                                                    {"handshaking", "handshake"},
                                                                                    {"highfives", "high_five"},
                                                                                    {"highfiving", "high_five"},
                                                                                    {"waving", "wave"},
                                                                                    {"wavinghand", "wave"},
                                                                                    {"wavehand", "wave"},
                                                                                    {"bow", "bend"},
                                                                                    {"bowing", "bend"},
                                                                                    {"bending", "bend"},
                                                                                    {"shaking", "handshake"},
                                                                                    {"shake", "handshake"},
                                                                                    {"waves", "wave"},
                                                                                    {"wavegoodbye", "wave"},
                                                                                    {"bows", "bend"},
                                                                                    {"blowingkiss", "fly_kiss"},
                                                                                    {"blowakiss", "fly_kiss"},
                                                                                    {"fistbumping", "fist_bump"},
                                                                                    {"blowkiss", "fly_kiss"}}};

bool is_plain_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(fs::symlink_status(path, ignored));
}

// Calls `take` for each clip's folder; stops where it says so.
template <typename Take>
bool walk(const std::string& folder, int depth, bool (*is_clip)(const std::string&), const Take& take) {
  if (is_clip(folder)) return take(folder);
  if (depth == 0) return true;
  for (const std::string& name : names_in(folder)) {
    const std::string below = folder + "/" + name;
    if (is_plain_folder(below) && !walk(below, depth - 1, is_clip, take)) return false;
  }
  return true;
}

}  // namespace

std::optional<Task> task_of_label(std::string_view label) {
  const std::string text = letters(label);
  for (const Task task : all_tasks())
    if (letters(to_string(task)) == text) return task;
  for (const auto& [theirs, ours] : kLabels)
    if (theirs == text) return parse_task(ours);
  return std::nullopt;
}

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    std::string name = at->path().filename().string();
    if (!name.starts_with('.')) names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<std::string> folders_below(std::span<const std::string> paths, int depth,
                                       bool (*is_clip)(const std::string&)) {
  std::vector<std::string> found;
  for (const std::string& path : paths)
    walk(path, depth, is_clip, [&](const std::string& folder) {
      found.push_back(folder);
      return true;
    });
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

bool any_folder_below(std::span<const std::string> paths, int depth, bool (*is_clip)(const std::string&)) {
  bool any = false;
  for (const std::string& path : paths)
    walk(path, depth, is_clip, [&](const std::string&) {
      any = true;
      return false;
    });
  return any;
}

bool is_file(const std::string& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

std::string stem_of(const std::string& path) { return fs::path(path).stem().string(); }
std::string file_name_of(const std::string& path) { return fs::path(path).filename().string(); }

std::string id_of(const std::string& path, int parts) {
  std::string id;
  fs::path at(path);
  if (!at.has_filename()) at = at.parent_path();
  for (int i = 0; i < parts && at.has_filename(); ++i, at = at.parent_path())
    id = at.filename().string() + (id.empty() ? "" : "-") + id;
  for (char& c : id)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && std::string_view("_.+-").find(c) == std::string_view::npos)
      c = '_';
  return id;
}

std::vector<std::string> numbered_files(const std::string& folder, std::string_view ending) {
  std::vector<std::pair<int, std::string>> numbered;
  for (const std::string& name : names_in(folder)) {
    if (!name.ends_with(ending)) continue;
    const std::string digits = stem_of(name);
    int number = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    if (error != std::errc() || end != digits.data() + digits.size())
      throw InputError(fmt::format("'{}': expected files named by the number of the frame, found '{}'", excerpt(folder),
                                   excerpt(name)));
    numbered.emplace_back(number, folder + "/" + name);
  }
  std::sort(numbered.begin(), numbered.end());
  std::vector<std::string> files;
  for (std::size_t i = 0; i < numbered.size(); ++i) {
    if (i > 0 && numbered[i].first != numbered[i - 1].first + 1)
      throw InputError(fmt::format("'{}': after frame {} expected the next one, found {}", excerpt(folder),
                                   numbered[i - 1].first, numbered[i].first));
    files.push_back(numbered[i].second);
  }
  return files;
}

NpyArray read_npy(const std::string& path) {
  return with_file_context(path, [&] { return parse_npy(read_data(path)); });
}

std::vector<double> numbers_of(NpyArray array, const std::string& what) {
  if (auto* values = std::get_if<std::vector<double>>(&array.values)) return std::move(*values);
  if (const auto* integers = std::get_if<std::vector<std::int64_t>>(&array.values))
    return {integers->begin(), integers->end()};
  throw InputError(fmt::format("{}: expected numbers, found texts", what));
}

PointTracks tracks_of(NpyArray array, int points, const std::string& what) {
  const std::vector<std::size_t> shape = array.shape;
  const auto wanted = static_cast<std::size_t>(points);
  const bool flat = shape.size() == 2 && shape[1] >= 3 * wanted;
  const bool points_each = shape.size() == 3 && shape[1] >= wanted && (shape[2] == 3 || shape[2] == 4);
  if (!flat && !points_each)
    throw InputError(fmt::format("{}: expected shape (T, {}, 3), found {}", what, points, shape_text(shape)));
  std::vector<double> values = numbers_of(std::move(array), what);
  const std::size_t frames = shape[0], stride = flat ? 3 : shape[2], row = flat ? shape[1] : shape[1] * shape[2];
  if (row == 3 * wanted) return {static_cast<int>(frames), points, std::move(values)};
  PointTracks tracks(static_cast<int>(frames), points);
  for (std::size_t t = 0; t < frames; ++t)
    for (std::size_t k = 0; k < wanted; ++k)
      for (std::size_t axis = 0; axis < 3; ++axis)
        tracks.data()[(t * wanted + k) * 3 + axis] = values[t * row + k * stride + axis];
  return tracks;
}

const PickleNode& get(const Pickle& pickle, const PickleNode& dict, std::string_view key) {
  if (dict.kind != PickleKind::kDict)
    pickle.fail(dict.offset, fmt::format("expected a dict, found {}", to_string(dict.kind)));
  if (const PickleNode* found = pickle.find(dict, key)) return *found;
  std::string keys;
  for (std::size_t i = 0; i + 1 < dict.items.size(); i += 2)
    keys += fmt::format("{}{}", keys.empty() ? "" : ", ", pickle[dict.items[i]].text);
  pickle.fail(dict.offset, fmt::format("no key '{}'; it has: {}", key, excerpt(keys, kShownSentence)));
}

void refuse_paths(std::span<const std::string> paths, const std::string& expected) {
  throw InputError(
      fmt::format("'{}': expected {}, found none",
                  excerpt(fmt::format("{}", fmt::join(paths.begin(), paths.end(), "', '")), kShownSentence), expected));
}

}  // namespace duet
