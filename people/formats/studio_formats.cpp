// Formats of capture studios: CHI3D, CORE4D, Harmony4D, Hi4D.
#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/archives/npy/npy.h"
#include "duet/archives/npy/npz.h"
#include "duet/archives/pickle/pickle_files.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/people_format.h"

namespace duet {

// CHI3D: <subject>/joints3d_25/<action>.json, {"joints3d_25": [2][T][25][3]}: Human3.6M's 17 joints and two points a
// hand and foot; the first person wears markers. z up, metres, 50 frames a second. Source: IMAR's data set tools.

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

// CORE4D, people and an object: <date>/<sequence>/person1_poses.npz and person2_poses.npz, in each the dict 'arr_0'
// with joints (T, 127, 3) of SMPL-X; smooth_objposes.npy (T, 4, 4). Metres, 15 frames a second as aligned with the
// images. Source: file_definitions.md of CORE4D-Instructions.

namespace {

constexpr double kCore4dRate = 15.0;
constexpr int kCore4dDepth = 3;
constexpr double kRigid = 1e-3;  // a rotation's columns are unit and at right angles to this

bool is_core4d_clip(const std::string& folder) {
  return is_file(folder + "/person1_poses.npz") && is_file(folder + "/person2_poses.npz");
}

bool recognises_core4d(std::span<const std::string> paths) {
  return any_folder_below(paths, kCore4dDepth, is_core4d_clip);
}

std::vector<ClipPlace> find_core4d(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  std::vector<ClipPlace> places;
  for (const std::string& folder : folders_below(paths, kCore4dDepth, is_core4d_clip)) {
    ClipPlace place{.id = id_of(folder, 2),
                    .files = {folder + "/person1_poses.npz", folder + "/person2_poses.npz"},
                    .entry = "arr_0"};
    if (is_file(folder + "/smooth_objposes.npy")) place.files.push_back(folder + "/smooth_objposes.npy");
    places.push_back(std::move(place));
  }
  if (places.empty()) refuse_paths(paths, "folders with person1_poses.npz and person2_poses.npz");
  return places;
}

NpyArray joints_of(const std::string& path) {
  std::string content;
  const ZipLimits limits{.entry_bytes = kMaxEntryBytes, .total_bytes = kMaxEntryBytes};
  read_zip(
      read_data(path), path, limits, [](const std::string& entry) { return entry == "arr_0.npy"; },
      [&](const std::string&, const std::string& bytes) { content = bytes; });
  if (content.empty()) throw InputError(fmt::format("'{}': no array 'arr_0', which holds the dict of a person", path));
  const Pickle pickle = parse_object_npy(content, path);
  const PickleNode& joints = get(pickle, pickle[pickle.root], "joints");
  return {joints.shape, array_values(pickle, joints, "key 'joints'")};
}

std::vector<Pose> object_poses(const std::string& path) {
  NpyArray array = read_npy(path);
  if (array.shape.size() != 3 || array.shape[1] != 4 || array.shape[2] != 4)
    throw InputError(fmt::format("'{}': expected shape (T, 4, 4), found {}", path, shape_text(array.shape)));
  const std::size_t frames = array.shape[0];
  const std::vector<double> values = numbers_of(std::move(array), fmt::format("'{}'", path));
  std::vector<Pose> poses;
  for (std::size_t t = 0; t < frames; ++t) {
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> X(&values[16 * t]);
    const Eigen::Matrix3d R = X.topLeftCorner<3, 3>();
    if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kRigid && R.determinant() > 0.0 &&
          X.col(3).allFinite()))
      throw InputError(fmt::format("'{}': frame {}: expected a rigid pose, found another matrix", path, t));
    poses.push_back({Eigen::Quaterniond(R).normalized(), X.topRightCorner<3, 1>()});
  }
  return poses;
}

RawPeople read_core4d(const ClipPlace& place, const PeopleOptions& /*options*/) {
  RawPeople people{.id = place.id, .name = place.files.at(0), .layout = &joint_layout("smplx-127"), .joints = {}};
  for (const std::size_t who : {0U, 1U})
    people.joints[who] =
        tracks_of(joints_of(place.files.at(who)), 127, fmt::format("'{}': key 'joints'", place.files[who]));
  people.rate_hz = kCore4dRate;
  people.metres_per_unit = 1.0;
  people.source = {{"format", "core4d"}, {"file_a", place.files[0]}, {"file_b", place.files[1]}};
  if (place.files.size() < 3) return people;
  std::vector<Pose> object = object_poses(place.files[2]);
  if (object.size() != static_cast<std::size_t>(people.joints[0].frames())) {
    people.evidence.push_back(fmt::format("object: left out, {} poses for {} frames of the people", object.size(),
                                          people.joints[0].frames()));
    return people;
  }
  people.evidence.push_back(fmt::format("object: {} poses", object.size()));
  people.source["object"] = place.files[2];
  people.object = std::move(object);
  return people;
}

}  // namespace

PeopleFormat core4d_format() {
  return {.name = "core4d",
          .what = "CORE4D: folders with person1_poses.npz and person2_poses.npz; the object's poses beside them",
          .licence = "CC BY 4.0",
          .recognises = recognises_core4d,
          .find = find_core4d,
          .read = read_core4d};
}

// Harmony4D: .../<nn>_<action>/<nnn>_<action>/processed_data/poses3d/%05d.npy, a file a frame, each a dict of two
// people (17, 4): COCO joints and a confidence. z up, metres, 20 frames a second. Source: the data set's own code.

namespace {

constexpr double kHarmonyRate = 20.0;
constexpr int kHarmonyDepth = 6, kHarmonyJoints = 17;

bool is_harmony_clip(const std::string& folder) {
  if (file_name_of(folder) != "poses3d") return false;
  for (const std::string& name : names_in(folder))
    if (name.ends_with(".npy")) return true;
  return false;
}

bool recognises_harmony(std::span<const std::string> paths) {
  return any_folder_below(paths, kHarmonyDepth, is_harmony_clip);
}

// The folder above processed_data/poses3d.
std::string sequence_of(const std::string& folder) {
  std::filesystem::path at = std::filesystem::path(folder).parent_path();
  if (at.filename() == "processed_data") at = at.parent_path();
  return at.string();
}

std::vector<ClipPlace> find_harmony(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  std::vector<ClipPlace> places;
  for (const std::string& folder : folders_below(paths, kHarmonyDepth, is_harmony_clip))
    places.push_back({.id = id_of(sequence_of(folder), 3), .files = {folder}, .entry = {}});
  if (places.empty()) refuse_paths(paths, "folders poses3d of one .npy a frame");
  return places;
}

struct HarmonyFrame {
  std::array<std::string, 2> who;
  std::array<std::vector<double>, 2> values;
  std::array<std::size_t, 2> width{};
};

HarmonyFrame read_harmony_frame(const std::string& path) {
  const std::string bytes = read_data(path);
  const Pickle pickle = parse_object_npy(bytes, path);
  const PickleNode& dict = pickle[pickle.root];
  if (dict.kind != PickleKind::kDict || dict.items.size() != 4)
    pickle.fail(dict.offset, fmt::format("expected a dict of two people, found {} of {}", to_string(dict.kind),
                                         dict.items.size() / 2));
  HarmonyFrame frame;
  for (const std::size_t i : {0U, 1U}) {
    const PickleNode& name = pickle[dict.items[2 * i]];
    const PickleNode& points = pickle[dict.items[2 * i + 1]];
    frame.who[i] = std::string(name.text);
    frame.values[i] = array_values(pickle, points, fmt::format("person '{}'", excerpt(name.text)));
    if (points.shape.size() != 2 || points.shape[0] != kHarmonyJoints || points.shape[1] < 3 || points.shape[1] > 4)
      pickle.fail(points.offset, fmt::format("person '{}': expected shape (17, 4), found ({})", excerpt(name.text),
                                             fmt::join(points.shape, ", ")));
    frame.width[i] = points.shape[1];
  }
  if (frame.who[0] <= frame.who[1]) return frame;
  std::swap(frame.who[0], frame.who[1]);
  std::swap(frame.values[0], frame.values[1]);
  std::swap(frame.width[0], frame.width[1]);
  return frame;
}

RawPeople read_harmony(const ClipPlace& place, const PeopleOptions& /*options*/) {
  const std::string& folder = place.files.at(0);
  RawPeople people{.id = place.id, .name = folder, .layout = &joint_layout("coco-17"), .joints = {}};
  const std::vector<std::string> files = numbered_files(folder, ".npy");
  people.joints.fill(PointTracks(static_cast<int>(files.size()), kHarmonyJoints));
  std::array<std::string, 2> who;
  for (std::size_t t = 0; t < files.size(); ++t) {
    const HarmonyFrame frame = read_harmony_frame(files[t]);
    if (t == 0) who = frame.who;
    if (frame.who != who)
      throw InputError(fmt::format("'{}': expected people '{}' and '{}' as in the first frame, found '{}' and '{}'",
                                   files[t], excerpt(who[0]), excerpt(who[1]), excerpt(frame.who[0]),
                                   excerpt(frame.who[1])));
    for (const std::size_t i : {0U, 1U})
      for (int k = 0; k < kHarmonyJoints; ++k)
        people.joints[i].at(static_cast<int>(t), k) =
            Eigen::Map<const Eigen::Vector3d>(&frame.values[i][static_cast<std::size_t>(k) * frame.width[i]]);
  }
  people.rate_hz = kHarmonyRate;
  people.up = Axis::kPlusZ;
  people.metres_per_unit = 1.0;
  people.evidence.push_back(fmt::format("people: A is '{}', B is '{}'", excerpt(who[0]), excerpt(who[1])));
  people.source = {{"format", "harmony4d"}, {"folder", folder}, {"label", file_name_of(sequence_of(folder))}};
  people.task = task_of_label(people.source["label"]);
  return people;
}

}  // namespace

PeopleFormat harmony4d_format() {
  return {.name = "harmony4d",
          .what = "Harmony4D: folders poses3d of one .npy a frame, a dict of two people (17, 4)",
          .licence = {},
          .recognises = recognises_harmony,
          .find = find_harmony,
          .read = read_harmony};
}

// Hi4D: pairXX/actionXX/{meta.npz, smpl/%06d.npz}, a file a frame with joints_3d (2, 24, 3) of SMPL beside meshes that
// are not read. y up, metres, 30 frames a second. Source: the data set's own description and viewer.

namespace {

constexpr double kHi4dRate = 30.0;
constexpr int kHi4dDepth = 3;

bool is_hi4d_clip(const std::string& folder) {
  return is_file(folder + "/meta.npz") && std::filesystem::is_directory(folder + "/smpl");
}

bool recognises_hi4d(std::span<const std::string> paths) { return any_folder_below(paths, kHi4dDepth, is_hi4d_clip); }

std::vector<ClipPlace> find_hi4d(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  std::vector<ClipPlace> places;
  for (const std::string& folder : folders_below(paths, kHi4dDepth, is_hi4d_clip))
    places.push_back({.id = id_of(folder, 2), .files = {folder}, .entry = {}});
  if (places.empty()) refuse_paths(paths, "folders with meta.npz and smpl/<frame>.npz");
  return places;
}

RawPeople read_hi4d(const ClipPlace& place, const PeopleOptions& /*options*/) {
  const std::string& folder = place.files.at(0);
  RawPeople people{.id = place.id, .name = folder, .layout = &joint_layout("smpl-24"), .joints = {}};
  const std::vector<std::string> files = numbered_files(folder + "/smpl", ".npz");
  people.joints.fill(PointTracks(static_cast<int>(files.size()), kSmplJoints));
  for (std::size_t t = 0; t < files.size(); ++t) {
    const std::vector<double> values = Npz::load(files[t], {"joints_3d"}).numbers("joints_3d", {2, kSmplJoints, 3});
    for (const std::size_t who : {0U, 1U})
      people.joints[who].frame(static_cast<int>(t)) =
          Eigen::Map<const Eigen::Matrix3Xd>(&values[who * 3 * kSmplJoints], 3, kSmplJoints);
  }
  people.rate_hz = kHi4dRate;
  people.up = Axis::kPlusY;
  people.metres_per_unit = 1.0;
  people.source = {{"format", "hi4d"}, {"folder", folder}, {"label", file_name_of(folder)}};
  people.task = task_of_label(people.source["label"]);
  return people;
}

}  // namespace

PeopleFormat hi4d_format() {
  return {.name = "hi4d",
          .what = "Hi4D: folders with meta.npz and smpl/<frame>.npz (joints_3d)",
          .licence = {},
          .recognises = recognises_hi4d,
          .find = find_hi4d,
          .read = read_hi4d};
}

}  // namespace duet
