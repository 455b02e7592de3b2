// A pair of BVH files, one a person, through motion/bvh.h.
#include <fmt/format.h>

#include <filesystem>

#include "duet/core/require.h"
#include "duet/motion/bvh.h"
#include "duet/motion/bvh_kinematics.h"
#include "duet/motion/bvh_skeleton.h"
#include "duet/motion/people/people_files.h"
#include "duet/motion/people/people_readers.h"

namespace duet {
namespace {

bool is_bvh(const std::string& path) { return std::filesystem::path(path).extension() == ".bvh" && is_file(path); }

bool recognises_bvh(std::span<const std::string> paths) {
  for (const std::string& path : paths)
    if (!is_bvh(path)) return false;
  return !paths.empty();
}

std::vector<ClipPlace> find_bvh(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  if (paths.size() != 2)
    throw InputError(fmt::format("expected a pair of BVH files, one a person, found {}", paths.size()));
  return {{.id = stem_of(paths[0]) + "-" + stem_of(paths[1]), .files = {paths[0], paths[1]}, .entry = {}}};
}

BvhOptions bvh_options(const PeopleOptions& options) {
  BvhOptions bvh{.metres_per_unit = options.metres_per_unit,
                 .up = {},
                 .rate_hz = options.rate_hz,
                 .drop_t_pose = options.drop_t_pose,
                 .output_rate_hz = options.output_rate_hz};
  if (options.up) {
    if (*options.up != Axis::kPlusY && *options.up != Axis::kPlusZ)
      throw InputError("BVH files have y or z up, found another axis");
    bvh.up = *options.up == Axis::kPlusY ? UpAxis::kY : UpAxis::kZ;
  }
  return bvh;
}

// What a skeleton of bones has no use for is refused, not ignored.
void check_bvh_options(const PeopleOptions& options) {
  const auto refuse_option = [](const char* what) {
    throw InputError(fmt::format("BVH files are imported with their own {}: that option does not apply", what));
  };
  if (options.mirrored) refuse_option("sides");
  if (options.level && *options.level) refuse_option("level world");
  if (options.floor) refuse_option("heights");
  if (!options.skeleton.empty()) refuse_option("skeleton");
}

// Positions at the file's own rate, in its axes and unit.
RawPeople read_bvh_people(const ClipPlace& place, const PeopleOptions& options) {
  check_bvh_options(options);
  RawPeople people{.id = place.id, .name = place.files.at(0), .layout = &joint_layout("smpl-24"), .joints = {}};
  for (const std::size_t who : {0U, 1U}) {
    const Bvh bvh = read_bvh(place.files.at(who));
    const BvhSkeleton skeleton = find_smpl_joints(bvh);
    people.joints[who] = PointTracks(bvh.frames, kSmplJoints);
    for (int t = 0; t < bvh.frames; ++t)
      people.joints[who].frame(t) = smpl_positions(skeleton, global_poses(bvh, local_poses(bvh, t)));
    people.rate_hz = 1.0 / bvh.frame_time;
  }
  people.source = {{"format", "BVH"}, {"file_a", place.files[0]}, {"file_b", place.files[1]}};
  return people;
}

SourceClip bvh_clip(const ClipPlace& place, const PeopleOptions& options) {
  check_bvh_options(options);
  if (!options.task)
    throw InputError(fmt::format("'{}': nothing says which task it is; state the task", place.files.at(0)));
  BvhImport imported = import_bvh_pair(place.files.at(0), place.files.at(1), *options.task, bvh_options(options));
  set_reactor(imported.clip, options.reactor.value_or(Person::kB));
  return {std::move(imported.clip), std::move(imported.verdict)};
}

}  // namespace

PeopleFormat bvh_format() {
  return {.name = "bvh",
          .what = "a pair of BVH files, one a person (CMU, LAFAN1, Mixamo, OptiTrack, Nokov, Xsens, SOMA)",
          .licence = {},
          .recognises = recognises_bvh,
          .find = find_bvh,
          .read = read_bvh_people,
          .clip = bvh_clip};
}

}  // namespace duet
