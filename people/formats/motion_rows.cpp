#include "duet/people/formats/motion_rows.h"

#include <fmt/format.h>

#include <utility>

#include "duet/archives/npy/npy_header.h"
#include "duet/core/data_file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/people/body_people.h"
#include "duet/people/clip_files.h"

namespace duet {
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
