#include "duet/people/formats/inter/inter_x_h5.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "duet/archives/npy/npy_header.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/body_people.h"
#include "duet/people/clip_files.h"
#include "duet/people/formats/inter/inter_x.h"
#include "duet/people/hdf5/hdf5.h"

namespace duet {
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
  const std::string what = fmt::format("'{}': clip '{}'", shown(path), shown(clip));
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
