// A format of two-person motion: it finds its clips below the paths that a user names and reads one at a time; nothing
// of a data set but the clip at hand is in memory. people_formats.h has the table.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/motion/people/people_options.h"
#include "duet/motion/people/raw_people.h"
#include "duet/motion/people/source_clip.h"

namespace duet {

// Where one clip is: its files (person A's first where there are two) and, in a container, its entry.
struct ClipPlace {
  std::string id;
  std::vector<std::string> files;
  std::string entry;
  std::map<std::string, std::string> notes = {};  // what the data set's own lists say of it: "split", "actor", ...
};

struct PeopleFormat {
  std::string_view name;     // "inter-x", "interhuman-raw", "bvh", "positions", ...
  std::string_view what;     // one line for lists and --help
  std::string_view licence;  // what the data set's own page says, for the manifest; empty: unknown
  // Whether these paths (files or folders, as the user gave them) are of this format; by names and magic, not by whole
  // files.
  bool (*recognises)(std::span<const std::string> paths);
  // The clips below, in the order of their files. Throws InputError naming the path.
  std::vector<ClipPlace> (*find)(std::span<const std::string> paths, const PeopleOptions& options);
  // Throws InputError naming file, place, expected and found.
  RawPeople (*read)(const ClipPlace& place, const PeopleOptions& options);
  // Where a format has a way of its own from file to clip (BVH: rotations are resampled, so that bones keep their
  // lengths); null: clip_of(read(...)).
  SourceClip (*clip)(const ClipPlace& place, const PeopleOptions& options) = nullptr;
  bool states_task = false;  // each of its clips says which task it is
};

}  // namespace duet
