// Two people in BVH, a pair of files or one that holds both, through
// people/bvh/bvh.h.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>

#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/bvh/bvh.h"
#include "duet/people/bvh/bvh_skeleton.h"
#include "duet/people/people_format.h"

namespace duet {
namespace {

bool is_bvh(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  return (extension == ".bvh" || extension == ".BVH") && is_file(path);
}

bool recognises_bvh(std::span<const std::string> paths) {
  for (const std::string& path : paths)
    if (!is_bvh(path)) return false;
  return !paths.empty();
}

std::vector<ClipPlace> find_bvh(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  if (paths.size() == 1) return {{.id = stem_of(paths[0]), .files = {paths[0]}, .entry = {}}};
  if (paths.size() != 2)
    throw InputError(
        fmt::format("expected a pair of BVH files, one a person, "
                    "or one that holds both, found {}",
                    paths.size()));
  return {{.id = stem_of(paths[0]) + "-" + stem_of(paths[1]), .files = {paths[0], paths[1]}, .entry = {}}};
}

BvhOptions bvh_options(const PeopleOptions& options) {
  BvhOptions bvh{.metres_per_unit = options.metres_per_unit,
                 .up = {},
                 .rate_hz = options.rate_hz,
                 .drop_t_pose = options.drop_t_pose,
                 .output_rate_hz = options.output_rate_hz,
                 .skeleton = options.skeleton};
  if (options.up) {
    if (*options.up != Axis::kPlusY && *options.up != Axis::kPlusZ)
      throw InputError("BVH files have y or z up, found another axis");
    bvh.up = *options.up == Axis::kPlusY ? UpAxis::kY : UpAxis::kZ;
  }
  return bvh;
}

// Refuses options that a skeleton of bones has no use for, rather than ignoring them.
void check_bvh_options(const PeopleOptions& options) {
  const auto refuse_option = [](const char* what) {
    throw InputError(fmt::format("BVH files are imported with their own {}: that option does not apply", what));
  };
  if (options.mirrored) refuse_option("sides");
  if (options.level && *options.level) refuse_option("level world");
  if (options.floor) refuse_option("heights");
}

std::array<Bvh, 2> read_both(const ClipPlace& place, const PeopleOptions& options) {
  if (place.files.size() == 1) return two_people_in(read_bvh(place.files[0]), options.skeleton);
  return {read_bvh(place.files.at(0)), read_bvh(place.files.at(1))};
}

// SMPL's joints without toes: those are made of the others.
std::shared_ptr<const JointLayout> layout_without_toes() {
  std::vector<std::string> names(kSmplNames.begin(), kSmplNames.end());
  for (const SmplJoint toe : {kRightToe, kLeftToe}) names.erase(names.begin() + toe);
  return std::make_shared<const JointLayout>(layout_of_names("smpl-24 without toes", std::move(names)));
}

// Positions at the file's own rate, in its axes and unit.
RawPeople read_bvh_people(const ClipPlace& place, const PeopleOptions& options) {
  check_bvh_options(options);
  const std::array<Bvh, 2> files = read_both(place, options);
  const std::array<BvhSkeleton, 2> skeletons = {find_smpl_joints(files[0], options.skeleton),
                                                find_smpl_joints(files[1], options.skeleton)};
  RawPeople people{.id = place.id, .name = place.files.at(0), .layout = &joint_layout("smpl-24"), .joints = {}};
  const auto whole = [](const BvhSkeleton& skeleton) { return !skeleton.lacks_toe[0] && !skeleton.lacks_toe[1]; };
  if (!std::all_of(skeletons.begin(), skeletons.end(), whole)) {
    people.made = layout_without_toes();
    people.layout = people.made.get();
  }
  const int frames = std::min(files[0].frames, files[1].frames);
  for (const std::size_t who : {0U, 1U}) {
    people.joints[who] = PointTracks(frames, static_cast<int>(people.layout->names.size()));
    for (int t = 0; t < frames; ++t) {
      const SmplPositions smpl = smpl_positions(skeletons[who], global_poses(files[who], local_poses(files[who], t)));
      int column = 0;
      for (int j = 0; j < kSmplJoints; ++j)
        if (!people.made || (j != kLeftToe && j != kRightToe)) people.joints[who].frame(t).col(column++) = smpl.col(j);
    }
    people.rate_hz = 1.0 / files[who].frame_time;
  }
  people.source = {{"format", "BVH"}, {"file_a", place.files.front()}, {"file_b", place.files.back()}};
  return people;
}

SourceClip bvh_clip(const ClipPlace& place, const PeopleOptions& options) {
  check_bvh_options(options);
  if (!options.task)
    throw InputError(fmt::format("'{}': nothing says which task it is; state the task", place.files.at(0)));
  const std::array<Bvh, 2> people = read_both(place, options);
  BvhImport imported = import_bvh_pair(people[0], people[1], *options.task, bvh_options(options));
  imported.clip.id = place.id;
  set_reactor(imported.clip, options.reactor.value_or(Person::kB));
  return {std::move(imported.clip), std::move(imported.verdict)};
}

}  // namespace

PeopleFormat bvh_format() {
  return {.name = "bvh",
          .what =
              "two people in BVH: a pair of files, or one that holds both "
              "(CMU, LAFAN1, Mixamo, OptiTrack, Nokov, Xsens, "
              "SOMA, Rokoko, Biped, Bandai-Namco, SMPL, Unity; others by "
              "--skeleton)",
          .licence = {},
          .recognises = recognises_bvh,
          .find = find_bvh,
          .read = read_bvh_people,
          .clip = bvh_clip};
}

}  // namespace duet
