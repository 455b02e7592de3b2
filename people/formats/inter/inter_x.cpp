#include "duet/people/formats/inter/inter_x.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include "duet/archives/npy/npy.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/body_people.h"
#include "duet/people/hdf5/hdf5.h"
#include "duet/people/people_format.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr double kInterXSmplxRate = 120.0;
constexpr int kFoldersUp = 3;  // from a clip's folder to the data set's own, at most

bool is_first_person(const std::string& name) { return name == "P1.npz"; }

bool is_inter_x_archive(const std::string& path) {
  const std::vector<std::string> entries = zip_entry_names(path);
  const auto has = [&](const char* name) { return std::find(entries.begin(), entries.end(), name) != entries.end(); };
  return has("root_orient.npy") && has("pose_body.npy") && has("trans.npy") && has("pose_lhand.npy");
}

bool recognises_inter_x_smplx(std::span<const std::string> paths) {
  if (paths.size() == 1 && fs::is_directory(paths[0])) {
    const std::string first = first_file_at(paths[0], is_first_person);
    return !first.empty() && is_inter_x_archive(first);
  }
  return paths.size() == 2 && std::all_of(paths.begin(), paths.end(), is_inter_x_archive);
}

std::vector<ClipPlace> find_inter_x_smplx(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  if (paths.size() == 2 && !fs::is_directory(paths[0]) && !fs::is_directory(paths[1])) {
    const std::string folder = fs::path(paths[0]).parent_path().filename().string();
    return {{.id = folder.empty() ? file_stem(paths[0]) + "-" + file_stem(paths[1]) : folder,
             .files = {paths[0], paths[1]},
             .entry = ""}};
  }
  std::vector<ClipPlace> clips;
  for (const std::string& path : paths)
    for (const std::string& file : files_at(path, is_first_person)) {
      const fs::path folder = fs::path(file).parent_path();
      clips.push_back({.id = folder.filename().string(), .files = {file, (folder / "P2.npz").string()}, .entry = ""});
    }
  if (clips.empty())
    throw InputError(
        fmt::format("'{}': expected two files, or a folder with P1.npz and P2.npz below it", excerpt(paths[0])));
  std::sort(clips.begin(), clips.end(), [](const ClipPlace& a, const ClipPlace& b) { return a.id < b.id; });
  return clips;
}

BodyMotion read_inter_x_person(const std::string& path) {
  const Npz npz = Npz::load(path, {"root_orient", "pose_body", "trans", "betas"});
  BodyMotion motion =
      body_motion(path, table_of(npz, "root_orient"), table_of(npz, "pose_body"), table_of(npz, "trans"));
  if (npz.contains("betas")) motion.betas = mean_betas(table_of(npz, "betas"));
  return motion;
}

// An action that is no task of duet is a label all the same: nobody looks for a task in it.
void find_task(const std::string& clip, RawPeople& raw) {
  const std::optional<std::string> action = inter_x_action(clip);
  if (!action) return;
  raw.source["label"] = *action;
  raw.task = task_of_label(*action);
  raw.evidence.push_back(fmt::format("action: '{}' (of the clip's name)", *action));
}

std::string find_order_file(const std::string& file) {
  fs::path folder = fs::absolute(file).parent_path();
  for (int up = 0; up <= kFoldersUp; ++up, folder = folder.parent_path()) {
    const fs::path order = folder / "annots" / "interaction_order.pkl";
    std::error_code ignored;
    if (fs::is_regular_file(order, ignored)) return order.string();
  }
  return "";
}

// {clip: 0 or 1}: which of P1 and P2 acts; the other reacts.
void find_reactor(const std::string& clip, const std::string& file, RawPeople& raw) {
  const std::string path = find_order_file(file);
  if (path.empty()) {
    raw.evidence.emplace_back("reactor: P2 (no annots/interaction_order.pkl above the clip)");
    return;
  }
  const std::string bytes = read_data(path);
  const Pickle pickle = parse_pickle(bytes, path);
  const PickleNode* order = pickle.find(pickle[pickle.root], clip);
  if (order == nullptr) {
    raw.evidence.push_back(fmt::format("reactor: P2 (interaction_order.pkl does not name '{}')", excerpt(clip)));
    return;
  }
  std::int64_t actor = order->integer;
  if (order->kind == PickleKind::kArray) {
    const std::vector<double> values = array_values(pickle, *order, "interaction order");
    actor = values.size() == 1 && (values[0] == 0.0 || values[0] == 1.0) ? static_cast<std::int64_t>(values[0]) : -1;
  } else if (order->kind != PickleKind::kInt) {
    actor = -1;
  }
  if (actor != 0 && actor != 1)
    pickle.fail(order->offset, fmt::format("'{}': expected 0 (P1 acts) or 1 (P2 acts)", excerpt(clip)));
  raw.reactor = actor == 0 ? Person::kB : Person::kA;
  raw.evidence.push_back(fmt::format("reactor: P{} (interaction_order.pkl: P{} acts)", actor == 0 ? 2 : 1, actor + 1));
}

RawPeople read_inter_x_smplx(const ClipPlace& place, const PeopleOptions& options) {
  RawPeople raw{.id = place.id, .name = place.files[0], .joints = {}};
  raw.rate_hz = kInterXSmplxRate;
  raw.up = Axis::kPlusY;
  raw.metres_per_unit = 1.0;
  raw.evidence.emplace_back("layout: Inter-X, SMPL-X parameters: y up, metres, 120 Hz");
  note_inter_x_clip(place.id, place.files[0], raw);
  add_people(raw,
             {.format = "inter-x",
              .licence = kInterXLicence,
              .people = {read_inter_x_person(place.files[0]), read_inter_x_person(place.files[1])}},
             options);
  return raw;
}

}  // namespace

void note_inter_x_clip(const std::string& clip, const std::string& file, RawPeople& raw) {
  find_task(clip, raw);
  find_reactor(clip, file, raw);
}

const PeopleFormat& inter_x_format() {
  static const PeopleFormat format{.name = "inter-x",
                                   .what = "Inter-X: SMPL-X parameters in <clip>/P1.npz and P2.npz",
                                   .licence = kInterXLicence,
                                   .recognises = recognises_inter_x_smplx,
                                   .find = find_inter_x_smplx,
                                   .read = read_inter_x_smplx};
  return format;
}

namespace {

constexpr std::array<const char*, 40> kInterXActions = {"Hug",
                                                        "Handshake",
                                                        "Wave",
                                                        "Grab",
                                                        "Hit",
                                                        "Kick",
                                                        "Posing",
                                                        "Push",
                                                        "Pull",
                                                        "Sit on leg",
                                                        "Slap",
                                                        "Pat on back",
                                                        "Point finger at",
                                                        "Walk towards",
                                                        "Knock over",
                                                        "Step on foot",
                                                        "High-five",
                                                        "Chase",
                                                        "Whisper in ear",
                                                        "Support with hand",
                                                        "Rock-paper-scissors",
                                                        "Dance",
                                                        "Link arms",
                                                        "Shoulder to shoulder",
                                                        "Bend",
                                                        "Carry on back",
                                                        "Massaging shoulder",
                                                        "Massaging leg",
                                                        "Hand wrestling",
                                                        "Chat",
                                                        "Pat on cheek",
                                                        "Thumb up",
                                                        "Touch head",
                                                        "Imitate",
                                                        "Kiss on cheek",
                                                        "Help up",
                                                        "Cover mouth",
                                                        "Look back",
                                                        "Block",
                                                        "Fly kiss"};

}  // namespace

std::optional<std::string> inter_x_action(const std::string& clip) {
  const std::size_t at = clip.find('A');
  if (clip.size() != 16 || clip[0] != 'G' || at != 8) return std::nullopt;
  int number = 0;
  for (std::size_t i = 9; i < 12; ++i) {
    if (clip[i] < '0' || clip[i] > '9') return std::nullopt;
    number = 10 * number + (clip[i] - '0');
  }
  if (number >= static_cast<int>(kInterXActions.size())) return std::nullopt;
  return kInterXActions[static_cast<std::size_t>(number)];
}

// Inter-X, the skeletons: skeletons/GgggTtttAaaaRrrr/P1.npy and P2.npy, each (T, 64, 3) of Motive's skeleton, y up,
// metres, 120 Hz; annots/interaction_order.pkl says who acts (0: P1), splits/*.txt which clips are for what. Source:
// the data set's own viewer and README.

namespace {

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
        throw InputError(fmt::format("'{}/{}': expected names of clips, found '{}'", folder, name, excerpt(line)));
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

namespace {

constexpr double kInterXH5Rate = 30.0;
// A frame: 56 rows of six numbers, of person 1 the first three, of person 2 the others.
constexpr std::size_t kH5Rows = 56, kH5Row = 6;
constexpr std::size_t kH5Root = 0, kH5Body = 1, kH5BodyJoints = 21, kH5Translation = 55;  // rows; between: face, hands

bool is_h5_name(const std::string& name) { return name.ends_with(".h5") || name.ends_with(".hdf5"); }

bool is_hdf5(const std::string& path) { return leading_bytes(path, kHdf5Signature.size()) == kHdf5Signature; }

bool is_inter_x_h5(const std::string& path) {
  if (is_file(path)) return is_hdf5(path);
  const std::string first = first_file_at(path, is_h5_name);
  return !first.empty() && is_hdf5(first);
}

bool recognises_inter_x_h5(std::span<const std::string> paths) {
  return !paths.empty() && std::all_of(paths.begin(), paths.end(), is_inter_x_h5);
}

std::vector<ClipPlace> find_inter_x_h5(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  std::vector<ClipPlace> clips;
  for (const std::string& path : paths)
    for (const std::string& file : is_file(path) ? std::vector<std::string>{path} : files_at(path, is_h5_name))
      for (const std::string& clip : Hdf5File(file).names())
        clips.push_back({.id = id_of(clip, 1), .files = {file}, .entry = clip, .notes = {{"split", file_stem(file)}}});
  if (clips.empty()) refuse_paths(paths, "HDF5 files with an array (T, 56, 6) a clip");
  return clips;
}

// Rows [first, first + count) of one person, frame by frame.
NumberTable rows_of(const NumberTable& table, std::size_t person, std::size_t first, std::size_t count) {
  const std::size_t frames = table.shape[0];
  NumberTable part{.what = table.what, .shape = {frames, 3 * count}, .values = {}};
  part.values.reserve(frames * 3 * count);
  for (std::size_t t = 0; t < frames; ++t)
    for (std::size_t row = first; row < first + count; ++row) {
      const double* numbers = &table.values[(t * kH5Rows + row) * kH5Row + 3 * person];
      part.values.insert(part.values.end(), numbers, numbers + 3);
    }
  return part;
}

NumberTable read_h5_clip(const std::string& path, const std::string& clip) {
  Hdf5File file(path);
  const std::string what = fmt::format("'{}': clip '{}'", excerpt(path), excerpt(clip));
  // Looked at before the numbers are: a file of another kind has arrays of any size.
  const std::vector<std::size_t> shape = file.shape(clip);
  if (shape.size() != 3 || shape[0] == 0 || shape[1] != kH5Rows || shape[2] != kH5Row)
    throw InputError(fmt::format("{}: expected shape (T, 56, 6), found {}", what, shape_text(shape)));
  return table_of(file.array(clip), what);
}

RawPeople read_inter_x_h5(const ClipPlace& place, const PeopleOptions& options) {
  const std::string& path = place.files.at(0);
  const NumberTable table = read_h5_clip(path, place.entry);
  RawPeople raw{.id = place.id, .name = path, .joints = {}};
  raw.rate_hz = kInterXH5Rate;
  raw.up = Axis::kPlusY;
  raw.metres_per_unit = 1.0;
  raw.evidence.emplace_back("layout: Inter-X in HDF5, SMPL-X parameters of the mean shape: y up, metres, 30 Hz");
  note_inter_x_clip(place.entry, path, raw);
  raw.source["clip"] = place.entry;
  if (const auto split = place.notes.find("split"); split != place.notes.end()) raw.source["split"] = split->second;
  std::array<BodyMotion, 2> people;
  for (const std::size_t who : {0U, 1U})
    people[who] = body_motion(path, rows_of(table, who, kH5Root, 1), rows_of(table, who, kH5Body, kH5BodyJoints),
                              rows_of(table, who, kH5Translation, 1));
  add_people(raw, {.format = "inter-x-h5", .licence = kInterXLicence, .people = std::move(people)}, options);
  return raw;
}

}  // namespace

const PeopleFormat& inter_x_h5_format() {
  static const PeopleFormat format{.name = "inter-x-h5",
                                   .what = "Inter-X in HDF5: train.h5, val.h5, test.h5, an array (T, 56, 6) a clip",
                                   .licence = kInterXLicence,
                                   .recognises = recognises_inter_x_h5,
                                   .find = find_inter_x_h5,
                                   .read = read_inter_x_h5};
  return format;
}

}  // namespace duet
