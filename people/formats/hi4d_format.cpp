// Hi4D: pairXX/actionXX/{meta.npz, smpl/%06d.npz}, a file a frame with joints_3d (2, 24, 3) of SMPL beside meshes that
// are not read. y up, metres, 30 frames a second. Source: the data set's own description and viewer.
#include <fmt/format.h>

#include <filesystem>

#include "duet/archives/npy/npz.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/people_readers.h"

namespace duet {
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
