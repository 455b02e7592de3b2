// duet's own clips (docs/file-formats.md, "Interaction clip"): what `duet import` and `duet synth` wrote goes the way
// of any recording.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "duet/archives/npy/npz.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/motion/plausibility.h"
#include "duet/people/people_format.h"

namespace duet {
namespace {

bool is_duet_clip(const std::string& path) {
  if (!path.ends_with(".npz") || !is_file(path)) return false;
  const std::vector<std::string> entries = zip_entry_names(path);
  const auto has = [&](const char* name) { return std::find(entries.begin(), entries.end(), name) != entries.end(); };
  return has("schema.npy") && has("a_joints.npy") && has("b_joints.npy");
}

std::vector<std::string> clips_in(const std::string& path) {
  if (is_duet_clip(path)) return {path};
  std::vector<std::string> files;
  for (const std::string& name : names_in(path)) {
    const std::string file = (std::filesystem::path(path) / name).string();
    if (is_duet_clip(file)) files.push_back(file);
  }
  return files;
}

bool recognises_clips(std::span<const std::string> paths) {
  return !paths.empty() &&
         std::all_of(paths.begin(), paths.end(), [](const std::string& path) { return !clips_in(path).empty(); });
}

std::vector<ClipPlace> find_clips(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  std::vector<ClipPlace> places;
  for (const std::string& path : paths)
    for (const std::string& file : clips_in(path))
      places.push_back({.id = id_of(stem_of(file), 1), .files = {file}, .entry = {}});
  if (places.empty()) refuse_paths(paths, "clips of duet (.npz)");
  return places;
}

// A clip says these itself.
void check_clip_options(const PeopleOptions& options) {
  const auto refuse_option = [](const char* what) {
    throw InputError(fmt::format("clips of duet have their own {}: that option does not apply", what));
  };
  if (options.metres_per_unit) refuse_option("unit");
  if (options.up) refuse_option("up axis");
  if (options.mirrored) refuse_option("sides");
  if (options.level && *options.level) refuse_option("level world");
  if (options.floor) refuse_option("heights");
  if (options.rate_hz) refuse_option("rate");
  if (!options.skeleton.empty()) refuse_option("skeleton");
}

RawPeople people_of(InteractionClip clip, const ClipPlace& place) {
  RawPeople people{.id = place.id, .name = place.files.at(0), .layout = &joint_layout("smpl-24"), .joints = {}};
  people.joints = {std::move(clip.a.joints), std::move(clip.b.joints)};
  people.rate_hz = clip.a.rate_hz;
  people.up = Axis::kPlusZ;
  people.metres_per_unit = 1.0;
  people.task = clip.task;
  people.reactor = clip.reactor;
  people.phases = clip.phases;
  people.object = std::move(clip.object.poses);
  people.source = std::move(clip.source);
  people.source["label"] = to_string(clip.task);
  return people;
}

RawPeople read_clip_people(const ClipPlace& place, const PeopleOptions& options) {
  check_clip_options(options);
  return people_of(load_clip(place.files.at(0)), place);
}

// At the rate that is asked for a clip is taken as it is, with its rotations and contacts.
SourceClip take_clip(const ClipPlace& place, const PeopleOptions& options) {
  check_clip_options(options);
  const Npz npz = Npz::load(place.files.at(0));
  ImportedClip read = read_foreign_clip(npz, options.as_is ? Implausible::kAllowed : Implausible::kRefused);
  if (read.clip.rate_hz() != options.output_rate_hz) return clip_of(people_of(std::move(read.clip), place), options);
  SourceClip result{.clip = std::move(read.clip), .evidence = {"a clip of duet, taken as it is"}};
  for (const std::string& note : read.notes) result.evidence.push_back("not as expected: " + note);
  if (options.task) result.clip.task = *options.task;
  result.clip.id = place.id;
  if (options.reactor) set_reactor(result.clip, *options.reactor);
  return result;
}

}  // namespace

PeopleFormat clip_format() {
  return {.name = "duet-clip",
          .what = "clips of duet itself: what `duet import` and `duet synth` write",
          .licence = {},
          .recognises = recognises_clips,
          .find = find_clips,
          .read = read_clip_people,
          .clip = take_clip,
          .states_task = true};
}

}  // namespace duet
