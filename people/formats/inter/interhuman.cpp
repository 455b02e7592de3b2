// InterHuman, as prepared by InterGen and as published.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/body_people.h"
#include "duet/people/people_format.h"

namespace duet {

// InterHuman as InterGen prepares it: person1/<n>.npy and person2/<n>.npy, (T, 492): 62 joints of SMPL-H, then
// rotations. z up, metres, 30 frames a second. Source: InterGen's loader.

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

namespace {

constexpr double kInterHumanRawRate = 60.0;
constexpr std::string_view kInterHumanRawLicence = "InterHuman: CC BY-NC-SA 4.0";
constexpr std::size_t kRecognitionBytes = 4096;

bool is_pickle_name(const std::string& name) { return name.ends_with(".pkl"); }

bool is_interhuman_file(const std::string& path) {
  const std::string bytes = leading_bytes(path, kRecognitionBytes);
  return bytes.starts_with('\x80') && bytes.find("person1") != std::string::npos;
}

bool recognises_interhuman_raw(std::span<const std::string> paths) {
  return !paths.empty() && std::all_of(paths.begin(), paths.end(), [](const std::string& path) {
    const std::string first = first_file_at(path, is_pickle_name);
    return !first.empty() && is_interhuman_file(first);
  });
}

std::vector<ClipPlace> find_interhuman_raw(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  return clips_at(paths, is_pickle_name, "InterHuman (.pkl)");
}

const PickleNode& interhuman_value(const Pickle& pickle, const PickleNode& dict, const std::string& key) {
  if (const PickleNode* node = pickle.find(dict, key)) return *node;
  pickle.fail(dict.offset, fmt::format("expected a dict with the key '{}', found {}", key,
                                       dict.kind == PickleKind::kDict ? "a dict without it" : to_string(dict.kind)));
}

BodyMotion interhuman_person(const Pickle& pickle, const std::string& who) {
  const PickleNode& person = interhuman_value(pickle, pickle[pickle.root], who);
  const auto table = [&](const std::string& key) {
    return table_of(pickle, interhuman_value(pickle, person, key), fmt::format("'{}' of {}", key, who));
  };
  BodyMotion motion = body_motion(pickle.name, table("root_orient"), table("pose_body"), table("trans"));
  if (pickle.find(person, "betas") != nullptr) motion.betas = mean_betas(table("betas"));
  return motion;
}

double interhuman_rate(const Pickle& pickle, std::vector<std::string>& evidence) {
  for (const char* key : {"mocap_framerate", "mocap_frame_rate", "fps"}) {
    const PickleNode* node = pickle.find(pickle[pickle.root], key);
    if (node == nullptr) continue;
    const double rate_hz = pickle_number(pickle, *node, fmt::format("'{}'", key));
    if (!(rate_hz > 0.0 && rate_hz <= 10'000.0))
      pickle.fail(node->offset, fmt::format("'{}': expected a rate of at most 10000 Hz, found {}", key, rate_hz));
    evidence.push_back(fmt::format("rate: {:g} Hz ('{}' of the file)", rate_hz, key));
    return rate_hz;
  }
  evidence.push_back(
      fmt::format("rate: {:g} Hz, as the data set was recorded (the file does not say; state the rate "
                  "where it is another)",
                  kInterHumanRawRate));
  return kInterHumanRawRate;
}

RawPeople read_interhuman_raw(const ClipPlace& place, const PeopleOptions& options) {
  const std::string bytes = read_data(place.files[0]);
  const Pickle pickle = parse_pickle(bytes, place.files[0]);
  RawPeople raw{.id = place.id, .name = place.files[0], .joints = {}};
  raw.up = Axis::kPlusZ;
  raw.metres_per_unit = 1.0;
  raw.evidence.emplace_back("layout: InterHuman, raw SMPL-H parameters: z up, metres");
  raw.rate_hz = interhuman_rate(pickle, raw.evidence);
  add_people(raw,
             {.format = "interhuman-raw",
              .licence = kInterHumanRawLicence,
              .people = {interhuman_person(pickle, "person1"), interhuman_person(pickle, "person2")}},
             options);
  return raw;
}

}  // namespace

const PeopleFormat& interhuman_raw_format() {
  static const PeopleFormat format{.name = "interhuman-raw",
                                   .what = "InterHuman: raw SMPL-H parameters of two people in <n>.pkl",
                                   .licence = kInterHumanRawLicence,
                                   .recognises = recognises_interhuman_raw,
                                   .find = find_interhuman_raw,
                                   .read = read_interhuman_raw};
  return format;
}

}  // namespace duet
