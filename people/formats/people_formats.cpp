#include "duet/people/formats/people_formats.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <map>

#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/formats/inter/inter_x.h"
#include "duet/people/people_format.h"

namespace duet {

namespace {

constexpr std::size_t kShownContents = 300;
constexpr std::size_t kShownFirstLine = 60;

// "2 .csv, 5 .png".
std::string counted_endings(const std::string& folder) {
  std::map<std::string, int> endings;
  for (const std::string& name : names_in(folder)) ++endings[std::filesystem::path(name).extension().string()];
  std::string text;
  for (const auto& [ending, count] : endings)
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, ending.empty() ? "without ending" : ending);
  return text;
}

// The content of a path, in words for a user who expected it to be read.
std::string contents_of(const std::string& path) {
  if (std::filesystem::is_directory(path)) {
    const std::string endings = counted_endings(path);
    return endings.empty() ? "the folder is empty" : fmt::format("the folder holds {}", endings);
  }
  std::vector<std::string> arrays = zip_entry_names(path);
  for (std::string& array : arrays)
    if (array.ends_with(".npy")) array.erase(array.size() - 4);
  if (!arrays.empty()) return fmt::format("the file holds {}", fmt::join(arrays, ", "));
  const std::string head = leading_bytes(path, kShownFirstLine);
  return fmt::format("the file begins with '{}'", excerpt(head.substr(0, head.find('\n')), kShownFirstLine));
}

}  // namespace

// The order is that of recognition: formats that are known by names of files and folders come before those that any
// table of positions may be.
std::span<const PeopleFormat> people_formats() {
  static const std::vector<PeopleFormat> table = {
      inter_x_skeleton_format(),
      inter_x_format(),
      inter_x_h5_format(),
      interhuman_raw_format(),
      interhuman_processed_format(),
      core4d_format(),
      harmony4d_format(),
      hi4d_format(),
      chi3d_format(),
      bvh_format(),
      ntu_format(),
      amass_format(),
      gvhmr_format(),
      wham_format(),
      four_d_humans_format(),
      motion_x_format(),
      phuma_human_format(),
      clip_format(),
      positions_format(),
  };
  return table;
}

std::vector<std::string> people_format_names() { return names_of(people_formats()); }

const PeopleFormat& find_people_format(std::span<const std::string> paths, std::string_view name) {
  require(!paths.empty(), "expected the path of a motion of two people, found none");
  for (const std::string& path : paths)
    if (!std::filesystem::exists(path))
      throw InputError(fmt::format("cannot read '{}': no such file or folder", excerpt(path)));
  for (const std::string& path : paths) require_data(path);
  for (const PeopleFormat& format : people_formats())
    if (name.empty() ? format.recognises(paths) : format.name == name) return format;
  if (!name.empty()) throw std::invalid_argument(unknown_name_message("format of people", name, people_format_names()));
  throw InputError(
      fmt::format("'{}': no motion of two people that is known: {}; `duet list people-formats` says what is read, "
                  "`duet list robot-formats` the motions of one robot",
                  excerpt(fmt::format("{}", fmt::join(paths.begin(), paths.end(), "', '")), kShownSentence / 4),
                  excerpt(contents_of(paths.front()), kShownContents)));
}

SourceClip read_source_clip(const PeopleFormat& format, const ClipPlace& place, const PeopleOptions& options) {
  SourceClip clip =
      format.clip != nullptr ? format.clip(place, options) : clip_of(format.read(place, options), options);
  clip.evidence.insert(clip.evidence.begin(), fmt::format("format: {}", format.name));
  if (!format.licence.empty()) clip.clip.source["licence"] = std::string(format.licence);
  return clip;
}

}  // namespace duet
