// Formats that hold one person a file: AMASS, GVHMR, and rows of numbers.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "duet/archives/npy/npy.h"
#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/people/body_people.h"
#include "duet/people/people_format.h"
#include "duet/people/video_person.h"

namespace duet {
namespace {

constexpr std::string_view kAmassLicence = "AMASS: non-commercial research";
constexpr std::size_t kRootNumbers = 3, kBodyNumbers = 63;

bool is_archive_name(const std::string& name) { return name.ends_with(".npz"); }
bool is_stage_i(const std::string& name) { return name.ends_with("_stagei.npz"); }

// AMASS keeps a shape.npz beside the motions of each subject.
bool is_amass_name(const std::string& name) {
  return is_archive_name(name) && name != "shape.npz" && !is_stage_i(name);
}

[[noreturn]] void refuse_stage_i(const std::string& path) {
  throw InputError(
      fmt::format("'{}': a stage-i file holds a subject's shape and no motion: expected the "
                  "'_stageii.npz' or '_poses.npz' beside it",
                  excerpt(path)));
}

bool is_amass_archive(const std::string& path) {
  const std::vector<std::string> entries = zip_entry_names(path);
  const auto has = [&](const char* name) { return std::find(entries.begin(), entries.end(), name) != entries.end(); };
  if (is_stage_i(path)) return true;
  if (has("mocap_framerate.npy") || has("mocap_frame_rate.npy"))
    return has("poses.npy") || (has("root_orient.npy") && has("pose_body.npy"));
  // Without a rate, what no other format has: Inter-X's bodies have hands of their own.
  return has("trans.npy") && (has("poses.npy") || has("pose_hand.npy"));
}

// A stage-i file too, so that it is refused by name.
bool recognises_amass(std::span<const std::string> paths) {
  return both_are(
      paths, [](const std::string& name) { return is_amass_name(name) || is_stage_i(name); }, is_amass_archive);
}

std::vector<ClipPlace> find_amass(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  for (const std::string& path : paths)
    if (is_stage_i(path)) refuse_stage_i(path);
  return pairs_at(paths, is_amass_name, "AMASS");
}

BodyMotion amass_motion(const Npz& npz, const std::string& path) {
  const NumberTable translation = table_of(npz, "trans");
  if (!npz.contains("poses"))
    return body_motion(path, table_of(npz, "root_orient"), table_of(npz, "pose_body"), translation);
  const NumberTable poses = table_of(npz, "poses");
  checked_rows(poses, {72, 156, 165}, "(T, 72), (T, 156) or (T, 165)");
  return body_motion(path, columns_of(poses, 0, kRootNumbers), columns_of(poses, kRootNumbers, kBodyNumbers),
                     translation);
}

struct AmassPerson {
  BodyMotion motion;
  double rate_hz = 0.0;  // 0: the file does not say
};

AmassPerson read_amass_person(const std::string& path) {
  const Npz npz = Npz::load(
      path, {"poses", "root_orient", "pose_body", "trans", "betas", "mocap_framerate", "mocap_frame_rate", "fps"});
  if (is_stage_i(path) || (!npz.contains("trans") && !npz.contains("poses"))) refuse_stage_i(path);
  AmassPerson person{.motion = amass_motion(npz, path)};
  if (npz.contains("betas")) person.motion.betas = mean_betas(table_of(npz, "betas"));
  for (const char* key : {"mocap_framerate", "mocap_frame_rate", "fps"}) {
    if (!npz.contains(key)) continue;
    person.rate_hz = npz.number_or_text(key);
    if (!(person.rate_hz > 0.0 && person.rate_hz <= 10'000.0))
      throw InputError(fmt::format("'{}': array '{}': expected a rate of at most 10000 Hz, found {}", excerpt(path),
                                   key, person.rate_hz));
    break;
  }
  return person;
}

RawPeople read_amass(const ClipPlace& place, const PeopleOptions& options) {
  AmassPerson a = read_amass_person(place.files[0]), b = read_amass_person(place.files[1]);
  if (a.rate_hz == 0.0 || b.rate_hz == 0.0) {
    if (!options.rate_hz)
      throw InputError(fmt::format("'{}': it states no rate (no array 'mocap_framerate'); state the rate",
                                   excerpt(place.files[a.rate_hz == 0.0 ? 0 : 1])));
    a.rate_hz = b.rate_hz = *options.rate_hz;
  }
  if (a.rate_hz != b.rate_hz)
    throw InputError(fmt::format("'{}' is at {:g} Hz and '{}' at {:g} Hz: expected two people at the same rate",
                                 excerpt(place.files[0]), a.rate_hz, excerpt(place.files[1]), b.rate_hz));
  RawPeople raw{.id = place.id, .name = place.files[0], .joints = {}};
  raw.rate_hz = a.rate_hz;
  raw.up = Axis::kPlusZ;
  raw.metres_per_unit = 1.0;
  raw.evidence.push_back(fmt::format("layout: AMASS: z up, metres, {:g} Hz", raw.rate_hz));
  add_people(raw,
             {.format = "amass",
              .licence = kAmassLicence,
              .people = {std::move(a.motion), std::move(b.motion)},
              .apart = true},
             options);
  return raw;
}

}  // namespace

const PeopleFormat& amass_format() {
  static const PeopleFormat format{.name = "amass",
                                   .what = "AMASS: one person a file (_poses.npz, _stageii.npz), two paths, --align",
                                   .licence = kAmassLicence,
                                   .recognises = recognises_amass,
                                   .find = find_amass,
                                   .read = read_amass};
  return format;
}

namespace {

constexpr double kGvhmrRate = 30.0;
constexpr std::string_view kGvhmrKey = "smpl_params_global", kGvhmrCameraKey = "smpl_params_incam";

bool is_torch_name(const std::string& name) { return name.ends_with(".pt"); }

bool is_torch_file(const std::string& path) {
  const std::vector<std::string> entries = zip_entry_names(path);
  const auto ends = [&](std::string_view end) {
    return std::any_of(entries.begin(), entries.end(), [&](const std::string& entry) { return entry.ends_with(end); });
  };
  return ends("/data.pkl") && !ends("/constants.pkl");  // those are of TorchScript
}

bool recognises_gvhmr(std::span<const std::string> paths) { return both_are(paths, is_torch_name, is_torch_file); }

std::vector<ClipPlace> find_gvhmr(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  return pairs_at(paths, is_torch_name, "GVHMR");
}

BodyMotion gvhmr_motion(const std::string& path, std::string_view gvhmr_key) {
  const TorchFile file = parse_torch(read_data(path), path);
  const Pickle& pickle = file.pickle;
  const PickleNode* parameters = pickle.find(pickle[pickle.root], gvhmr_key);
  if (parameters == nullptr || parameters->kind != PickleKind::kDict)
    throw InputError(fmt::format("'{}': expected a dict with the key '{}' (GVHMR's hmr4d_results.pt), found {}",
                                 excerpt(path), gvhmr_key,
                                 parameters == nullptr ? "none" : to_string(parameters->kind)));
  const auto table = [&](const std::string& key) {
    const PickleNode* node = pickle.find(*parameters, key);
    if (node == nullptr) throw InputError(fmt::format("'{}': no '{}' in '{}'", excerpt(path), key, gvhmr_key));
    return table_of(file, *node, fmt::format("'{}' of '{}'", key, gvhmr_key));
  };
  BodyMotion motion = body_motion(path, table("global_orient"), table("body_pose"), table("transl"));
  if (pickle.find(*parameters, "betas") != nullptr) motion.betas = mean_betas(table("betas"));
  return motion;
}

RawPeople read_gvhmr(const ClipPlace& place, const PeopleOptions& options) {
  RawPeople raw{.id = place.id, .name = place.files[0], .joints = {}};
  raw.rate_hz = kGvhmrRate;
  raw.up = Axis::kPlusY;
  raw.metres_per_unit = 1.0;
  raw.evidence.emplace_back("layout: GVHMR, smpl_params_global: y up, metres, 30 Hz; shapes are means over the frames");
  add_people(raw,
             {.format = "gvhmr",
              .licence = "",
              .people = {gvhmr_motion(place.files[0], kGvhmrKey), gvhmr_motion(place.files[1], kGvhmrKey)},
              .apart = true},
             options);
  return raw;
}

}  // namespace

bool is_torch_person(const std::string& path) { return is_torch_file(path); }

VideoPerson read_gvhmr_person(const std::string& path, const VideoPersonOptions& options) {
  BodyMotion motion = gvhmr_motion(path, kGvhmrCameraKey);
  for (Eigen::Vector3d& place : motion.translation) place.z() *= options.depth_scale;
  const PointTracks joints =
      pose_motion(motion, options.body_model.empty() ? average_body() : load_body_model(options.body_model));
  return {.format = "gvhmr",
          .rate_hz = options.rate_hz.value_or(kGvhmrRate),
          .joints = joints,
          .seen = std::vector<bool>(static_cast<std::size_t>(joints.frames()), true),
          .evidence = fmt::format("GVHMR, {}: {} frames", kGvhmrCameraKey, joints.frames())};
}

const PeopleFormat& gvhmr_format() {
  static const PeopleFormat format{.name = "gvhmr",
                                   .what = "GVHMR: one person a file (hmr4d_results.pt), two paths, --align",
                                   .licence = "",
                                   .recognises = recognises_gvhmr,
                                   .find = find_gvhmr,
                                   .read = read_gvhmr};
  return format;
}

namespace {

constexpr std::string_view kMotionXLicence = "Motion-X: non-commercial research";
constexpr std::size_t kHeaderBytes = 512;  // NumPy's is 128

// Which numbers of a row mean what.
struct RowLayout {
  std::string_view name;
  std::size_t width;
  std::size_t root, body, translation;
  std::size_t betas, beta_count;
  double rate_hz;
  std::optional<Axis> up;
  std::string_view evidence;
  std::string_view licence;
};
constexpr RowLayout kMotionX = {
    "motion-x",
    322,
    0,
    3,
    309,
    312,
    10,
    30.0,
    std::nullopt,
    "layout: Motion-X, rows of 322 numbers, 30 Hz; each clip has a camera's frame, so up is found from the data",
    kMotionXLicence};
constexpr RowLayout kPhumaHuman = {"phuma-human",
                                   69,
                                   3,
                                   6,
                                   0,
                                   0,
                                   0,
                                   30.0,
                                   Axis::kPlusY,
                                   "layout: PHUMA, human motion, rows of 69 numbers: y up, metres, 30 Hz; mean shape",
                                   ""};

bool is_npy_name(const std::string& name) { return name.ends_with(".npy"); }

bool is_row_file(const std::string& path, std::size_t width) {
  try {
    const NpyHeader header = parse_npy_header(leading_bytes(path, kHeaderBytes));
    return header.shape.size() == 2 && header.shape[1] == width;
  } catch (const InputError&) {
    return false;
  }
}

template <const RowLayout& kLayout>
bool recognises_rows(std::span<const std::string> paths) {
  return both_are(paths, is_npy_name, [](const std::string& path) { return is_row_file(path, kLayout.width); });
}

template <const RowLayout& kLayout>
std::vector<ClipPlace> find_rows(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  return pairs_at(paths, is_npy_name, kLayout.name);
}

BodyMotion read_row_person(const std::string& path, const RowLayout& layout) {
  const NumberTable table = npy_table(read_data(path), path);
  checked_rows(table, {layout.width}, fmt::format("(T, {})", layout.width));
  BodyMotion motion = body_motion(path, columns_of(table, layout.root, 3), columns_of(table, layout.body, 63),
                                  columns_of(table, layout.translation, 3));
  if (layout.beta_count > 0) motion.betas = mean_betas(columns_of(table, layout.betas, layout.beta_count));
  return motion;
}

template <const RowLayout& kLayout>
RawPeople read_rows(const ClipPlace& place, const PeopleOptions& options) {
  RawPeople raw{.id = place.id, .name = place.files[0], .joints = {}};
  raw.rate_hz = kLayout.rate_hz;
  raw.up = kLayout.up;
  raw.metres_per_unit = 1.0;
  raw.evidence.emplace_back(kLayout.evidence);
  add_people(raw,
             {.format = kLayout.name,
              .licence = kLayout.licence,
              .people = {read_row_person(place.files[0], kLayout), read_row_person(place.files[1], kLayout)},
              .apart = true},
             options);
  return raw;
}

template <const RowLayout& kLayout>
PeopleFormat row_format(std::string_view what) {
  return {.name = kLayout.name,
          .what = what,
          .licence = kLayout.licence,
          .recognises = recognises_rows<kLayout>,
          .find = find_rows<kLayout>,
          .read = read_rows<kLayout>};
}

}  // namespace

const PeopleFormat& motion_x_format() {
  static const PeopleFormat format =
      row_format<kMotionX>("Motion-X: one person a file (.npy, 322 numbers a frame), two paths, --align");
  return format;
}

const PeopleFormat& phuma_human_format() {
  static const PeopleFormat format =
      row_format<kPhumaHuman>("PHUMA: one person a file (.npy, 69 numbers a frame), two paths, --align");
  return format;
}

}  // namespace duet
