#include "duet/people/formats/amass.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "duet/archives/zip/zip.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/people/body_people.h"
#include "duet/people/clip_files.h"

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
                  shown(path)));
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
      throw InputError(fmt::format("'{}': array '{}': expected a rate of at most 10000 Hz, found {}", shown(path), key,
                                   person.rate_hz));
    break;
  }
  return person;
}

RawPeople read_amass(const ClipPlace& place, const PeopleOptions& options) {
  AmassPerson a = read_amass_person(place.files[0]), b = read_amass_person(place.files[1]);
  if (a.rate_hz == 0.0 || b.rate_hz == 0.0) {
    if (!options.rate_hz)
      throw InputError(fmt::format("'{}': it states no rate (no array 'mocap_framerate'); state the rate",
                                   shown(place.files[a.rate_hz == 0.0 ? 0 : 1])));
    a.rate_hz = b.rate_hz = *options.rate_hz;
  }
  if (a.rate_hz != b.rate_hz)
    throw InputError(fmt::format("'{}' is at {:g} Hz and '{}' at {:g} Hz: expected two people at the same rate",
                                 shown(place.files[0]), a.rate_hz, shown(place.files[1]), b.rate_hz));
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

}  // namespace duet
