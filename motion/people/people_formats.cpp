#include "duet/motion/people/people_formats.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/motion/people/amass.h"
#include "duet/motion/people/gvhmr.h"
#include "duet/motion/people/inter_x.h"
#include "duet/motion/people/inter_x_h5.h"
#include "duet/motion/people/interhuman_raw.h"
#include "duet/motion/people/motion_rows.h"
#include "duet/motion/people/people_readers.h"
#include "duet/motion/people/video_tracks.h"

namespace duet {

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
      amass_format(),
      gvhmr_format(),
      wham_format(),
      four_d_humans_format(),
      motion_x_format(),
      phuma_human_format(),
      positions_format(),
  };
  return table;
}

std::vector<std::string> people_format_names() {
  std::vector<std::string> names;
  for (const PeopleFormat& format : people_formats()) names.emplace_back(format.name);
  return names;
}

const PeopleFormat& find_people_format(std::span<const std::string> paths, std::string_view name) {
  require(!paths.empty(), "expected the path of a motion of two people, found none");
  for (const std::string& path : paths)
    if (!std::filesystem::exists(path))
      throw InputError(fmt::format("cannot read '{}': no such file or folder", shown(path)));
  for (const PeopleFormat& format : people_formats())
    if (name.empty() ? format.recognises(paths) : format.name == name) return format;
  if (!name.empty()) throw std::invalid_argument(unknown_name_message("format of people", name, people_format_names()));
  std::vector<std::string> looked_for;
  for (const PeopleFormat& format : people_formats())
    looked_for.push_back(fmt::format("{} ({})", format.name, format.what));
  throw InputError(
      fmt::format("'{}': no motion of two people that is known; looked for {}",
                  shown(fmt::format("{}", fmt::join(paths.begin(), paths.end(), "', '")), kShownSentence / 4),
                  fmt::join(looked_for, "; ")));
}

SourceClip read_source_clip(const PeopleFormat& format, const ClipPlace& place, const PeopleOptions& options) {
  SourceClip clip =
      format.clip != nullptr ? format.clip(place, options) : clip_of(format.read(place, options), options);
  clip.evidence.insert(clip.evidence.begin(), fmt::format("format: {}", format.name));
  if (!format.licence.empty()) clip.clip.source["licence"] = std::string(format.licence);
  return clip;
}

}  // namespace duet
