// CORE4D, people and an object: <date>/<sequence>/person1_poses.npz and person2_poses.npz, in each the dict 'arr_0'
// with joints (T, 127, 3) of SMPL-X; smooth_objposes.npy (T, 4, 4). Metres, 15 frames a second as aligned with the
// images. Source: file_definitions.md of CORE4D-Instructions.
#include <fmt/format.h>

#include "duet/archives/npy/npy_header.h"
#include "duet/archives/pickle/npy_objects.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/data_file.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/people_readers.h"

namespace duet {
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

}  // namespace duet
