// Harmony4D: .../<nn>_<action>/<nnn>_<action>/processed_data/poses3d/%05d.npy, a file a frame, each a dict of two
// people (17, 4): COCO joints and a confidence. z up, metres, 20 frames a second. Source: the data set's own code.
#include <fmt/format.h>

#include <filesystem>

#include "duet/archives/pickle/npy_objects.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/data_file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/people_readers.h"

namespace duet {
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
    frame.values[i] = array_values(pickle, points, fmt::format("person '{}'", shown(name.text)));
    if (points.shape.size() != 2 || points.shape[0] != kHarmonyJoints || points.shape[1] < 3 || points.shape[1] > 4)
      pickle.fail(points.offset, fmt::format("person '{}': expected shape (17, 4), found ({})", shown(name.text),
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
                                   files[t], shown(who[0]), shown(who[1]), shown(frame.who[0]), shown(frame.who[1])));
    for (const std::size_t i : {0U, 1U})
      for (int k = 0; k < kHarmonyJoints; ++k)
        people.joints[i].at(static_cast<int>(t), k) =
            Eigen::Map<const Eigen::Vector3d>(&frame.values[i][static_cast<std::size_t>(k) * frame.width[i]]);
  }
  people.rate_hz = kHarmonyRate;
  people.up = Axis::kPlusZ;
  people.metres_per_unit = 1.0;
  people.evidence.push_back(fmt::format("people: A is '{}', B is '{}'", shown(who[0]), shown(who[1])));
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

}  // namespace duet
