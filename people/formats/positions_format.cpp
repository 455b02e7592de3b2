// Joint positions of two people as people keep them themselves: NPZ, NPY and CSV with the joints of any skeleton
// (docs/file-formats.md, "Motions of others").
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "duet/archives/npy/npy.h"
#include "duet/archives/npy/npz.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_detection.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/formats/positions_csv.h"
#include "duet/people/people_format.h"

namespace duet {
namespace {

using Keys = std::vector<std::string>;

constexpr std::size_t kHeadBytes = std::size_t{1} << 16;  // holds the names of any table's columns

const Keys& both_keys() {  // (T, 2, J, 3)
  static const Keys keys = {"positions",       "joints3d", "joints_3d", "keypoints3d", "keypoints_3d",
                            "joint_positions", "poses3d",  "pose3d",    "xyz",         "joints"};
  return keys;
}
const std::vector<std::pair<std::string, std::string>>& each_keys() {  // (T, J, 3)
  static const std::vector<std::pair<std::string, std::string>> keys = {{"a", "b"},
                                                                        {"p1", "p2"},
                                                                        {"person1", "person2"},
                                                                        {"person_a", "person_b"},
                                                                        {"positions_a", "positions_b"},
                                                                        {"joints_a", "joints_b"}};
  return keys;
}
const Keys kNameKeys = {"joint_names", "names", "keypoint_names", "joints"};
const Keys kRateKeys = {"rate_hz", "fps", "frame_rate", "framerate", "mocap_frame_rate", "mocap_framerate"};
const Keys kLabelKeys = {"label", "action", "task"};
const Keys kUpKeys = {"up", "up_axis"};

std::string extension_of(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

// One that is no archive any more is taken for one of these: its reader says what is wrong with it.
bool is_positions_npz(const std::string& path) {
  const std::vector<std::string> entries = zip_entry_names(path);
  if (entries.empty()) return true;
  const auto has = [&](const std::string& key) {
    return std::find(entries.begin(), entries.end(), key + ".npy") != entries.end();
  };
  return std::any_of(both_keys().begin(), both_keys().end(), has) ||
         std::any_of(each_keys().begin(), each_keys().end(),
                     [&](const auto& pair) { return has(pair.first) && has(pair.second); });
}

bool is_table(const std::string& extension) {
  return extension == ".csv" || extension == ".tsv" || extension == ".txt";
}

// Tells by the names of its columns; the reader says so of a file that is no data at all.
bool may_hold_positions(const std::string& path) {
  const std::string head = leading_bytes(path, kHeadBytes);
  return names_positions(head) || (extension_of(path) == ".csv" && (head.empty() || !no_data_fault(head).empty()));
}

bool is_positions_file(const std::string& path) {
  const std::string extension = extension_of(path);
  if (!is_file(path)) return false;
  if (is_table(extension)) return may_hold_positions(path);
  return extension == ".npy" || (extension == ".npz" && is_positions_npz(path));
}

std::string in_folder(const std::string& folder, const std::string& name) { return fmt::format("{}/{}", folder, name); }

bool recognises_positions(std::span<const std::string> paths) {
  for (const std::string& path : paths) {
    if (is_positions_file(path)) continue;
    const std::vector<std::string> names = names_in(path);
    if (std::none_of(names.begin(), names.end(),
                     [&](const std::string& name) { return is_positions_file(in_folder(path, name)); }))
      return false;
  }
  return true;
}

// Whether one file holds both people; by its header. One whose header is broken is a clip that its reader refuses.
bool holds_both(const std::string& path) {
  const std::string extension = extension_of(path);
  if (extension == ".npz") return true;
  const std::string head = leading_bytes(path, kHeadBytes);
  try {
    if (!no_data_fault(head).empty()) return true;
    return is_table(extension) ? csv_has_two_people(head, path) : parse_npy_header(head).shape.size() != 3;
  } catch (const InputError&) {
    return true;
  }
}

// "dance_a" and "dance_b" are "dance": the id, and who (0 A, 1 B); nothing where the name ends in no person.
std::optional<std::pair<std::string, int>> split_person(const std::string& stem) {
  static const std::vector<std::pair<std::string, int>> endings = {{"person1", 0}, {"person2", 1}, {"p1", 0}, {"p2", 1},
                                                                   {"a", 0},       {"b", 1},       {"1", 0},  {"2", 1}};
  std::string lower = stem;
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const auto& [ending, who] : endings) {
    if (!lower.ends_with(ending)) continue;
    const std::size_t rest = stem.size() - ending.size();
    if (rest == 0) return std::pair{std::string("clip"), who};
    if (lower[rest - 1] == '_' || lower[rest - 1] == '-') return std::pair{stem.substr(0, rest - 1), who};
  }
  return std::nullopt;
}

// Person B's file beside person A's in a list of files; "" where there is none.
std::string partner_of(const std::string& file, const std::vector<std::string>& files) {
  const auto own = split_person(stem_of(file));
  for (const std::string& other : files) {
    const auto found = split_person(stem_of(other));
    if (own && found && own->second == 0 && found->second == 1 && own->first == found->first &&
        extension_of(file) == extension_of(other))
      return other;
  }
  return "";
}

std::vector<ClipPlace> find_positions(std::span<const std::string> paths, const PeopleOptions& options) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    if (is_file(path)) files.push_back(path);
    for (const std::string& name : names_in(path))
      if (is_positions_file(in_folder(path, name))) files.push_back(in_folder(path, name));
  }
  std::vector<ClipPlace> places;
  std::vector<std::string> single;
  for (const std::string& file : files) {
    if (holds_both(file) || options.still_partner)
      places.push_back({.id = id_of(stem_of(file), 1), .files = {file}, .entry = {}});
    else
      single.push_back(file);
  }
  if (paths.size() == 2 && single.size() == 2 && is_file(paths[0]) && is_file(paths[1]))
    return {{.id = id_of(stem_of(single[0]) + "-" + stem_of(single[1]), 1), .files = single, .entry = {}}};
  for (const std::string& file : single) {
    const std::string other = partner_of(file, single);
    const bool is_partner = std::any_of(single.begin(), single.end(),
                                        [&](const std::string& first) { return partner_of(first, single) == file; });
    if (is_partner) continue;
    if (other.empty())  // a clip that its reader refuses
      places.push_back({.id = id_of(stem_of(file), 1), .files = {file}, .entry = {}});
    else
      places.push_back({.id = id_of(split_person(stem_of(file))->first, 1), .files = {file, other}, .entry = {}});
  }
  if (places.empty()) refuse_paths(paths, "NPZ, NPY or CSV files of joint positions");
  return places;
}

// ---- what the files hold -------------------------------------------------------------------------------------------

constexpr std::string_view kStillPartner = "--still-partner lets somebody stand still in front";

PointTracks one_person(NpyArray array, const std::string& what) {
  if (array.shape.size() != 3 || array.shape[2] < 3 || array.shape[2] > 4)
    throw InputError(fmt::format("{}: expected shape (T, J, 3), found {}", what, shape_text(array.shape)));
  const auto points = static_cast<int>(array.shape[1]);
  return tracks_of(std::move(array), points, what);
}

// Both people of an array (T, 2, J, 3 or 4) or (2, T, J, 3 or 4); with a partner who stands still one's, (T, J, 3 or
// 4).
void split_people(NpyArray array, const std::string& what, const PeopleOptions& options, RawPeople& people) {
  const std::vector<std::size_t> shape = array.shape;
  const bool alone = shape.size() == 3 && (shape[2] == 3 || shape[2] == 4);
  if (alone && options.still_partner) {
    people.joints[0] = one_person(std::move(array), what);
    return;
  }
  const bool fits = shape.size() == 4 && (shape[3] == 3 || shape[3] == 4) && (shape[0] == 2 || shape[1] == 2);
  if (!fits)
    throw InputError(fmt::format("{}: expected shape (T, 2, J, 3) or (2, T, J, 3), found {}{}", what, shape_text(shape),
                                 alone ? fmt::format(", one person ({})", kStillPartner) : ""));
  const bool people_first = shape[1] != 2;
  const std::size_t frames = people_first ? shape[1] : shape[0], points = shape[2], width = shape[3];
  people.evidence.push_back(fmt::format("array: {} of shape {}, {}", what, shape_text(shape),
                                        people_first ? "people before frames" : "frames before people"));
  const std::vector<double> values = numbers_of(std::move(array), what);
  for (const std::size_t who : {0U, 1U}) {
    people.joints[who] = PointTracks(static_cast<int>(frames), static_cast<int>(points));
    std::vector<double>& to = people.joints[who].data();
    for (std::size_t t = 0; t < frames; ++t) {
      const double* from = &values[(people_first ? who * frames + t : 2 * t + who) * points * width];
      for (std::size_t k = 0; k < points; ++k)
        std::copy_n(from + k * width, 3, to.begin() + static_cast<std::ptrdiff_t>(3 * (t * points + k)));
    }
  }
}

std::string what_of(const std::string& file, const std::string& key) {
  return fmt::format("'{}': array '{}'", excerpt(file, kShownSentence), key);
}

// The names of the columns where the file has them.
Keys take_npz(const std::string& path, const PeopleOptions& options, RawPeople& people) {
  Keys wanted = both_keys();
  for (const auto& [a, b] : each_keys()) wanted.insert(wanted.end(), {a, b});
  for (const Keys* keys : {&kNameKeys, &kRateKeys, &kLabelKeys, &kUpKeys})
    wanted.insert(wanted.end(), keys->begin(), keys->end());
  const Npz npz = Npz::load(path, wanted);
  const auto is_text = [&](const std::string& key) {
    return npz.contains(key) && std::holds_alternative<std::vector<std::string>>(npz.array(key).values);
  };
  for (const std::string& key : both_keys())
    if (people.joints[0].empty() && npz.contains(key) && !is_text(key))
      split_people(npz.array(key), what_of(path, key), options, people);
  for (const auto& [a, b] : each_keys())
    if (people.joints[0].empty() && npz.contains(a) && npz.contains(b))
      people.joints = {one_person(npz.array(a), what_of(path, a)), one_person(npz.array(b), what_of(path, b))};
  if (people.joints[0].empty())
    throw InputError(fmt::format("'{}': no positions with values in it; looked for arrays {}",
                                 excerpt(path, kShownSentence), fmt::join(both_keys(), ", ")));
  for (const std::string& key : kRateKeys)
    if (npz.contains(key)) people.rate_hz = npz.number_or_text(key);
  for (const std::string& key : kLabelKeys)
    if (is_text(key)) people.source["label"] = npz.text(key);
  for (const std::string& key : kUpKeys)
    if (is_text(key)) people.up = with_file_context(path, [&] { return parse_axis(npz.text(key)); });
  for (const std::string& key : kNameKeys)
    if (is_text(key)) return npz.strings(key, {-1});
  return {};
}

Keys take_csv(const ClipPlace& place, const PeopleOptions& options, RawPeople& people) {
  const auto parsed = [&](const std::string& file) {
    PositionsCsv csv = parse_positions_csv(read_plain_text(file), file, options.fill_gaps);
    people.uneven = people.uneven || csv.uneven;
    return csv;
  };
  PositionsCsv first = parsed(place.files[0]);
  people.rate_hz = first.rate_hz;
  if (place.files.size() == 1) {
    if (!first.two_people && !options.still_partner)
      throw InputError(fmt::format("'{}': expected two people (columns a_... and b_...), found one ({})",
                                   excerpt(place.files[0]), kStillPartner));
    people.joints = std::move(first.tracks);
    return first.joints;
  }
  PositionsCsv second = parsed(place.files[1]);
  if (second.joints != first.joints)
    throw InputError(fmt::format("'{}': expected the joints of '{}', found others", excerpt(place.files[1]),
                                 excerpt(place.files[0])));
  if (second.rate_hz != first.rate_hz)
    throw InputError(fmt::format("'{}' is at {:g} Hz and '{}' at {:g} Hz: expected two people at the same rate",
                                 excerpt(place.files[0]), first.rate_hz, excerpt(place.files[1]), second.rate_hz));
  people.joints = {std::move(first.tracks[0]), std::move(second.tracks[0])};
  return first.joints;
}

void take_npy(const ClipPlace& place, const PeopleOptions& options, RawPeople& people) {
  if (place.files.size() == 1)
    return split_people(read_npy(place.files[0]), fmt::format("'{}'", excerpt(place.files[0], kShownSentence)), options,
                        people);
  for (const std::size_t who : {0U, 1U})
    people.joints[who] =
        one_person(read_npy(place.files[who]), fmt::format("'{}'", excerpt(place.files[who], kShownSentence)));
}

// ---- whose joints
// ----------------------------------------------------------------------------------------------------

JointLayout layout_for(const Keys& names, int columns, const std::string& file, const PeopleOptions& options,
                       std::string& sentence) {
  if (!options.skeleton.empty()) {
    sentence = fmt::format("skeleton: {} (as told)", options.skeleton);
    return read_joint_layout(options.skeleton, names, Legs::kMadeUp);
  }
  const std::vector<std::string> known = joint_layout_names();
  if (!names.empty()) {
    for (const std::string& name : known)
      if (joint_layout(name).names == names) {
        sentence = fmt::format("skeleton: {} (by the names of the joints)", name);
        return joint_layout(name);
      }
    sentence = fmt::format("skeleton: {} joints of the file's own names", names.size());
    JointLayout layout = layout_of_names("of the file", names, Legs::kMadeUp);
    layout.has_gaps = true;
    return layout;
  }
  Keys fitting;
  for (const std::string& name : known)
    if (static_cast<int>(joint_layout(name).names.size()) == columns) fitting.push_back(name);
  if (fitting.size() == 1 && columns != 15 && columns != 17 && columns != 20) {
    sentence = fmt::format("skeleton: {} (the only one known of {} joints)", fitting[0], columns);
    return joint_layout(fitting[0]);
  }
  throw InputError(fmt::format("'{}': nothing names its {} joints; state the skeleton{}", excerpt(file, kShownSentence),
                               columns,
                               fitting.empty() ? std::string(", or a file of names")
                                               : fmt::format(" ({}?), or a file of names", fmt::join(fitting, ", "))));
}

RawPeople read_positions(const ClipPlace& place, const PeopleOptions& options) {
  const std::string& file = place.files.at(0);
  RawPeople people{.id = place.id, .name = file, .layout = nullptr, .joints = {}};
  people.source = {{"format", "positions"}, {"file_a", file}};
  if (place.files.size() > 1) people.source["file_b"] = place.files[1];
  const std::string extension = extension_of(file);
  Keys names;
  if (extension == ".npz")
    names = take_npz(file, options, people);
  else if (is_table(extension))
    names = take_csv(place, options, people);
  else
    take_npy(place, options, people);
  std::string sentence;
  people.made =
      std::make_shared<const JointLayout>(layout_for(names, people.joints[0].points(), file, options, sentence));
  people.layout = people.made.get();
  people.evidence.push_back(sentence);
  if (const auto label = people.source.find("label"); label != people.source.end())
    people.task = task_of_label(label->second);
  return people;
}

}  // namespace

PeopleFormat positions_format() {
  return {.name = "positions",
          .what = "joint positions of two people: NPZ, NPY (T, 2, J, 3), CSV; or a file each",
          .licence = {},
          .recognises = recognises_positions,
          .find = find_positions,
          .read = read_positions};
}

}  // namespace duet
