#include "duet/people/formats/inter/inter_x.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "duet/archives/pickle/pickle_machine.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/data_file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/body_people.h"
#include "duet/people/clip_files.h"
#include "duet/people/formats/inter/inter_x_actions.h"

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
        fmt::format("'{}': expected two files, or a folder with P1.npz and P2.npz below it", shown(paths[0])));
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
    raw.evidence.push_back(fmt::format("reactor: P2 (interaction_order.pkl does not name '{}')", shown(clip)));
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
    pickle.fail(order->offset, fmt::format("'{}': expected 0 (P1 acts) or 1 (P2 acts)", shown(clip)));
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

}  // namespace duet
