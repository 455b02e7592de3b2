// A format of two-person motion: it finds its clips below the paths that a user names and reads one at a time; nothing
// of a data set but the clip at hand is in memory. people_formats.h has the table.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

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

// One function a format: its row of the table (people_formats.cpp). Its source says what its files hold,
// and by whose word.

PeopleFormat inter_x_skeleton_format();
PeopleFormat interhuman_processed_format();
PeopleFormat core4d_format();
PeopleFormat harmony4d_format();
PeopleFormat hi4d_format();
PeopleFormat chi3d_format();
PeopleFormat bvh_format();
PeopleFormat ntu_format();
PeopleFormat clip_format();
PeopleFormat positions_format();

// Files of data sets on a disk: which lie below a path, what they begin with, and which of two folders belong together.

// The path itself where it is a file, else the files below it whose name is `wanted`, sorted. Links to folders are not
// followed. Throws InputError naming the path: not there, not readable, a file of another name.
std::vector<std::string> files_at(const std::string& path, const std::function<bool(const std::string& name)>& wanted);

// The first such file, "" where there is none: what recognition looks at. Nothing is thrown.
std::string first_file_at(const std::string& path, const std::function<bool(const std::string& name)>& wanted);

// The first bytes of a file, fewer where it is shorter, none where it is not readable.
std::string leading_bytes(const std::string& path, std::size_t count);

std::string file_stem(const std::string& path);

// The clips of two paths, one per person: two files, or two folders whose files of the same name below them belong
// together. Throws InputError: another number of paths, a file beside a folder, no pair.
std::vector<ClipPlace> pairs_at(std::span<const std::string> paths,
                                const std::function<bool(const std::string& name)>& wanted, std::string_view format);

// Each file is one clip of two people.
std::vector<ClipPlace> clips_at(std::span<const std::string> paths,
                                const std::function<bool(const std::string& name)>& wanted, std::string_view format);

// Two paths at both of which `is_one` says yes to the first file that is `wanted`.
bool both_are(std::span<const std::string> paths, const std::function<bool(const std::string& name)>& wanted,
              const std::function<bool(const std::string& path)>& is_one);

// AMASS and what is stored like it: one person a file, z up; "_poses.npz" (SMPL-H: poses, trans, betas,
// mocap_framerate) and "_stageii.npz" (SMPL-X: root_orient, pose_body, trans, mocap_frame_rate). Both spellings of the
// rate are read.
const PeopleFormat& amass_format();

// The output of GVHMR for a video: hmr4d_results.pt, one person, SMPL-X parameters in a world of its own, y up, 30 Hz.
const PeopleFormat& gvhmr_format();

// One person a file as one row of numbers a frame, NPY: Motion-X (T, 322) and the human motions of PHUMA (T, 69).

const PeopleFormat& motion_x_format();
const PeopleFormat& phuma_human_format();

// People whom a tracker followed through one video, in one joblib file: WHAM (wham_output.pkl, a world of his own for
// each, y up) and 4D-Humans with PHALP (one camera's frame, y down, depth unreliable). Tracks begin and end with what
// the camera sees: of all pairs the one with the longest unbroken stretch in common is taken, and that stretch.

const PeopleFormat& wham_format();
const PeopleFormat& four_d_humans_format();

// Inter-X as its own preparation stores it: train.h5, val.h5 and test.h5, one array a clip, (T, 56, 6) at 30 Hz, y up.
const PeopleFormat& inter_x_h5_format();

// InterHuman as its authors' raw SMPL-H parameters: motions/<n>.pkl, a dict of person1 and person2, one world, z up.
const PeopleFormat& interhuman_raw_format();

}  // namespace duet
