// Inter-X, the skeletons: skeletons/GgggTtttAaaaRrrr/P1.npy and P2.npy, each (T, 64, 3) of Motive's skeleton, y up,
// metres, 120 Hz; annots/interaction_order.pkl says who acts (0: P1), splits/*.txt which clips are for what. Source:
// the data set's own viewer and README.
#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <sstream>

#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/data_file.h"
#include "duet/core/file.h"
#include "duet/core/plain_name.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/formats/inter/inter_x_actions.h"
#include "duet/people/people_readers.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr double kInterXRate = 120.0;
constexpr int kInterXDepth = 3;  // data set, skeletons, clip

bool is_inter_x_clip(const std::string& folder) { return is_file(folder + "/P1.npy") && is_file(folder + "/P2.npy"); }

// The nearest folder above a clip that has `name`; "" where none of three has.
std::string beside_clips(const std::string& clip, const std::string& name) {
  fs::path at = fs::path(clip).lexically_normal();
  for (int i = 0; i < kInterXDepth && at.has_parent_path() && at != at.parent_path(); ++i) {
    at = at.parent_path();
    if (fs::exists(at / name)) return (at / name).string();
  }
  return "";
}

// The person who acts in each clip: 0 P1, 1 P2.
std::map<std::string, int> read_order(const std::string& path) {
  std::map<std::string, int> order;
  if (path.empty()) return order;
  const std::string bytes = read_data(path);
  const Pickle pickle = parse_pickle(bytes, path);
  const PickleNode& root = pickle[pickle.root];
  if (root.kind != PickleKind::kDict)
    pickle.fail(root.offset, fmt::format("expected a dict, found {}", to_string(root.kind)));
  for (std::size_t i = 0; i + 1 < root.items.size(); i += 2) {
    const PickleNode& value = pickle[root.items[i + 1]];
    const double actor = value.kind == PickleKind::kInt || value.kind == PickleKind::kBool
                             ? static_cast<double>(value.integer)
                             : array_values(pickle, value, "interaction order").at(0);
    if (actor != 0.0 && actor != 1.0)
      pickle.fail(value.offset, fmt::format("expected 0 (P1 acts) or 1 (P2 acts), found {}", actor));
    order.emplace(pickle[root.items[i]].text, static_cast<int>(actor));
  }
  return order;
}

std::map<std::string, std::string> read_splits(const std::string& folder) {
  std::map<std::string, std::string> split_of;
  for (const std::string& name : names_in(folder)) {
    if (!name.ends_with(".txt") || name == "all.txt") continue;
    std::istringstream lines(read_plain_text(folder + "/" + name));
    for (std::string line; std::getline(lines, line);) {
      line.erase(line.find_last_not_of(" \r\t") + 1);
      if (line.empty()) continue;
      if (!is_plain_name(line))
        throw InputError(fmt::format("'{}/{}': expected names of clips, found '{}'", folder, name, shown(line)));
      split_of.emplace(line, stem_of(name));
    }
  }
  return split_of;
}

bool recognises_inter_x(std::span<const std::string> paths) {
  return any_folder_below(paths, kInterXDepth, is_inter_x_clip);
}

std::vector<ClipPlace> find_inter_x(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  const std::vector<std::string> folders = folders_below(paths, kInterXDepth, is_inter_x_clip);
  if (folders.empty()) refuse_paths(paths, "folders with P1.npy and P2.npy");
  const std::map<std::string, int> order = read_order(beside_clips(folders[0], "annots/interaction_order.pkl"));
  const std::map<std::string, std::string> split_of = read_splits(beside_clips(folders[0], "splits"));
  std::vector<ClipPlace> places;
  for (const std::string& folder : folders) {
    ClipPlace place{.id = id_of(folder, 1), .files = {folder + "/P1.npy", folder + "/P2.npy"}, .entry = {}};
    if (const auto found = order.find(file_name_of(folder)); found != order.end())
      place.notes["actor"] = found->second == 0 ? "A" : "B";
    if (const auto found = split_of.find(file_name_of(folder)); found != split_of.end())
      place.notes["split"] = found->second;
    places.push_back(std::move(place));
  }
  return places;
}

RawPeople read_inter_x(const ClipPlace& place, const PeopleOptions& /*options*/) {
  RawPeople people{.id = place.id, .name = place.files.at(0), .layout = &joint_layout("optitrack-64"), .joints = {}};
  for (const std::size_t who : {0U, 1U})
    people.joints[who] = tracks_of(read_npy(place.files.at(who)), 64, fmt::format("'{}'", place.files[who]));
  people.rate_hz = kInterXRate;
  people.up = Axis::kPlusY;
  people.metres_per_unit = 1.0;
  people.source = {{"format", "inter-x-skeleton"}, {"file_a", place.files[0]}, {"file_b", place.files[1]}};
  if (const auto action = inter_x_action(place.id)) {
    people.source["label"] = *action;
    people.task = task_of_label(*action);
    people.evidence.push_back(fmt::format("action: '{}' (of the clip's name)", *action));
  }
  if (const auto actor = place.notes.find("actor"); actor != place.notes.end()) {
    people.reactor = actor->second == "A" ? Person::kB : Person::kA;
    people.evidence.push_back(fmt::format("person {} acts (the data set's interaction order)", actor->second));
  }
  if (const auto split = place.notes.find("split"); split != place.notes.end()) people.source["split"] = split->second;
  return people;
}

}  // namespace

PeopleFormat inter_x_skeleton_format() {
  return {.name = "inter-x-skeleton",
          .what = "Inter-X skeletons: folders with P1.npy and P2.npy, (T, 64, 3)",
          .licence = {},
          .recognises = recognises_inter_x,
          .find = find_inter_x,
          .read = read_inter_x};
}

}  // namespace duet
