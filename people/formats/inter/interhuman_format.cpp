// InterHuman as InterGen prepares it: person1/<n>.npy and person2/<n>.npy, (T, 492): 62 joints of SMPL-H, then
// rotations. z up, metres, 30 frames a second. Source: InterGen's loader.
#include <fmt/format.h>

#include <filesystem>

#include "duet/motion/people/people_files.h"
#include "duet/people/people_readers.h"

namespace duet {
namespace {

constexpr double kInterHumanRate = 30.0;
constexpr int kInterHumanDepth = 2;

bool is_interhuman(const std::string& folder) {
  return std::filesystem::is_directory(folder + "/person1") && std::filesystem::is_directory(folder + "/person2");
}

bool recognises_interhuman(std::span<const std::string> paths) {
  return any_folder_below(paths, kInterHumanDepth, is_interhuman);
}

std::vector<ClipPlace> find_interhuman(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  std::vector<ClipPlace> places;
  for (const std::string& folder : folders_below(paths, kInterHumanDepth, is_interhuman))
    for (const std::string& name : names_in(folder + "/person1"))
      if (name.ends_with(".npy") && is_file(folder + "/person2/" + name))
        places.push_back({.id = id_of(stem_of(name), 1),
                          .files = {folder + "/person1/" + name, folder + "/person2/" + name},
                          .entry = {}});
  if (places.empty()) refuse_paths(paths, "person1/<n>.npy with person2/<n>.npy beside it");
  return places;
}

RawPeople read_interhuman(const ClipPlace& place, const PeopleOptions& /*options*/) {
  RawPeople people{.id = place.id, .name = place.files.at(0), .layout = &joint_layout("smpl-22"), .joints = {}};
  for (const std::size_t who : {0U, 1U})
    people.joints[who] = tracks_of(read_npy(place.files.at(who)), 22, fmt::format("'{}'", place.files[who]));
  people.rate_hz = kInterHumanRate;
  people.up = Axis::kPlusZ;
  people.metres_per_unit = 1.0;
  people.evidence.emplace_back("joints: the first 22 of a row are SMPL's; rotations are not read");
  people.source = {{"format", "interhuman-processed"}, {"file_a", place.files[0]}, {"file_b", place.files[1]}};
  return people;
}

}  // namespace

PeopleFormat interhuman_processed_format() {
  return {.name = "interhuman-processed",
          .what = "InterHuman as InterGen prepares it: person1/<n>.npy and person2/<n>.npy, (T, 492)",
          .licence = {},
          .recognises = recognises_interhuman,
          .find = find_interhuman,
          .read = read_interhuman};
}

}  // namespace duet
