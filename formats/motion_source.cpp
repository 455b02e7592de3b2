#include "duet/formats/motion_source.h"

#include <fmt/format.h>

#include <filesystem>

#include "duet/archives/npy/npy.h"
#include "duet/archives/pickle/joblib.h"
#include "duet/core/data_file.h"
#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::int64_t kMostSourceBytes = std::int64_t{1} << 30;  // hours of one robot
constexpr std::size_t kMostFolderFiles = 1000;
constexpr std::string_view kZipMagic = "PK";
constexpr std::string_view kNpyMagic = "\x93NUMPY";
constexpr char kPickleMagic = '\x80';

bool is_pickle_name(const std::string& name) {
  const std::string ending = std::filesystem::path(name).extension().string();
  return ending == ".pkl" || ending == ".pickle" || ending == ".joblib";
}

bool belongs_to_motion(const std::filesystem::path& file) {
  return file.extension() == ".csv" || file.extension() == ".txt";
}

MotionSource open_folder(const std::string& path) {
  MotionSource source{.path = path, .container = MotionContainer::kFolder};
  std::int64_t left = kMostSourceBytes;
  for (const auto& entry : std::filesystem::directory_iterator(path)) {
    const std::string name = entry.path().filename().string();
    if (!belongs_to_motion(entry.path())) continue;
    if (source.files.size() == kMostFolderFiles)
      throw InputError(
          fmt::format("'{}': expected the folder of one motion, found more than {} files", path, kMostFolderFiles));
    std::string content = read_data(inside(path, name), left);
    left -= static_cast<std::int64_t>(content.size());
    source.files.emplace(name, std::move(content));
  }
  return source;
}

}  // namespace

std::string_view to_string(MotionContainer container) {
  switch (container) {
    case MotionContainer::kNpz:
      return "an NPZ archive";
    case MotionContainer::kNpy:
      return "an NPY array";
    case MotionContainer::kPickle:
      return "a pickle";
    case MotionContainer::kTable:
      return "a table of numbers";
    case MotionContainer::kFolder:
      break;
  }
  return "a folder";
}

MotionSource motion_source(std::string bytes, const std::string& name) {
  if (bytes.empty()) throw InputError(fmt::format("'{}': the file is empty", name));
  MotionSource source{.path = name, .bytes = std::make_unique<const std::string>(std::move(bytes))};
  const std::string_view content = *source.bytes;
  if (content.starts_with(kZipMagic)) {
    source.container = MotionContainer::kNpz;
    source.npz = Npz::parse(content, name, ObjectArrays::kSkipped);
  } else if (content.starts_with(kNpyMagic)) {
    source.container = MotionContainer::kNpy;
    try {
      source.npy = parse_npy(content);
    } catch (const InputError& error) {
      throw InputError(fmt::format("'{}': {}", name, error.what()));
    }
  } else if (content.front() == kPickleMagic || is_pickle_name(name)) {
    source.container = MotionContainer::kPickle;
    source.pickle = parse_joblib(content, name);
  } else {
    source.table = parse_csv_table(content, name);
  }
  return source;
}

MotionSource open_motion_source(const std::string& path) {
  if (std::filesystem::is_directory(path)) return open_folder(path);
  return motion_source(read_data(path, kMostSourceBytes), path);
}

}  // namespace duet
