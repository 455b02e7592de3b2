// CHI3D: <subject>/joints3d_25/<action>.json, {"joints3d_25": [2][T][25][3]}: Human3.6M's 17 joints and two points a
// hand and foot; the first person wears markers. z up, metres, 50 frames a second. Source: IMAR's data set tools.
#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/core/data_file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/people_readers.h"

namespace duet {
namespace {

constexpr double kChi3dRate = 50.0;
constexpr int kChi3dDepth = 4, kChi3dJoints = 25;
constexpr std::int64_t kMostChi3dBytes = std::int64_t{64} << 20;  // a minute is 2 MB

bool is_chi3d_folder(const std::string& folder) {
  if (file_name_of(folder) != "joints3d_25") return false;
  for (const std::string& name : names_in(folder))
    if (name.ends_with(".json")) return true;
  return false;
}

bool is_chi3d_file(const std::string& path) {
  return path.ends_with(".json") && is_file(path) &&
         std::filesystem::path(path).parent_path().filename() == "joints3d_25";
}

bool recognises_chi3d(std::span<const std::string> paths) {
  for (const std::string& path : paths)
    if (!is_chi3d_file(path) && !any_folder_below(std::span(&path, 1), kChi3dDepth, is_chi3d_folder)) return false;
  return true;
}

std::vector<ClipPlace> find_chi3d(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  std::vector<ClipPlace> places;
  const auto add = [&](const std::string& file) {
    const std::string subject = std::filesystem::path(file).parent_path().parent_path().filename().string();
    places.push_back(
        {.id = id_of((subject.empty() ? "" : subject + "-") + stem_of(file), 1), .files = {file}, .entry = {}});
  };
  for (const std::string& path : paths) {
    if (is_file(path)) {
      if (path.ends_with(".json")) add(path);
      continue;
    }
    for (const std::string& folder : folders_below(std::span(&path, 1), kChi3dDepth, is_chi3d_folder))
      for (const std::string& name : names_in(folder))
        if (name.ends_with(".json")) add(folder + "/" + name);
  }
  if (places.empty()) refuse_paths(paths, "joints3d_25/<action>.json");
  return places;
}

[[noreturn]] void refuse_size(const std::string& file, const std::string& what, std::size_t expected,
                              const nlohmann::json& found) {
  throw InputError(fmt::format("'{}': {}: expected a list of {}, found {}", file, what, expected,
                               found.is_array() ? fmt::format("one of {}", found.size()) : found.type_name()));
}

PointTracks chi3d_person(const nlohmann::json& frames, const std::string& file, const char* who) {
  if (!frames.is_array()) refuse_size(file, who, 2, frames);
  PointTracks joints(static_cast<int>(frames.size()), kChi3dJoints);
  for (std::size_t t = 0; t < frames.size(); ++t) {
    const std::string frame = fmt::format("person {}, frame {}", who, t);
    if (!frames[t].is_array() || frames[t].size() != kChi3dJoints) refuse_size(file, frame, kChi3dJoints, frames[t]);
    for (int k = 0; k < kChi3dJoints; ++k) {
      const nlohmann::json& p = frames[t][static_cast<std::size_t>(k)];
      if (!p.is_array() || p.size() != 3) refuse_size(file, fmt::format("{}, joint {}", frame, k), 3, p);
      for (int axis = 0; axis < 3; ++axis) {
        const nlohmann::json& value = p[static_cast<std::size_t>(axis)];
        if (!value.is_number())
          throw InputError(
              fmt::format("'{}': {}, joint {}: expected a number, found {}", file, frame, k, value.type_name()));
        joints.at(static_cast<int>(t), k)[axis] = value.get<double>();
      }
    }
  }
  return joints;
}

RawPeople read_chi3d(const ClipPlace& place, const PeopleOptions& /*options*/) {
  const std::string& file = place.files.at(0);
  RawPeople people{.id = place.id, .name = file, .layout = &joint_layout("imar-25"), .joints = {}};
  const nlohmann::json root = parse_json(read_plain_text(file, kMostChi3dBytes), fmt::format("'{}'", file));
  const auto joints = root.is_object() ? root.find("joints3d_25") : root.end();
  if (!root.is_object() || joints == root.end())
    throw InputError(fmt::format("'{}': expected a JSON object with 'joints3d_25', found none", file));
  if (!joints->is_array() || joints->size() != 2) refuse_size(file, "joints3d_25 (people)", 2, *joints);
  people.joints = {chi3d_person((*joints)[0], file, "A"), chi3d_person((*joints)[1], file, "B")};
  people.rate_hz = kChi3dRate;
  people.up = Axis::kPlusZ;
  people.metres_per_unit = 1.0;
  people.evidence.emplace_back("people: A wears markers, B none");
  people.source = {{"format", "chi3d"}, {"file", file}, {"label", stem_of(file)}};
  people.task = task_of_label(people.source["label"]);
  return people;
}

}  // namespace

PeopleFormat chi3d_format() {
  return {.name = "chi3d",
          .what = "CHI3D: joints3d_25/<action>.json of two people",
          .licence = {},
          .recognises = recognises_chi3d,
          .find = find_chi3d,
          .read = read_chi3d};
}

}  // namespace duet
