// Names of joints as files have them, made alike: without the prefix that all
// of them share, or as a user's own file says. Thread-safe.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// "Actor1.LeftHand", "mixamorig_LeftHand", "Bip01 L Hand", "ns:LeftHand"
// without what stands before the joint: all up to a ':', and the longest
// beginning that ends in one of " _.-|" (or is a whole name) and that four
// fifths of the names share.
std::vector<std::string> without_prefix(const std::vector<std::string>& names);

// The SMPL joint that a name in the file stands for ("left_hip"), by that name.
using JointNameMap = std::map<std::string, std::string>;

// Lines "left_hip: Bone_12" (YAML of one level; '#' begins a comment, quotes
// may surround a name). Nothing where no line has a colon: a list of names.
// Throws InputError naming file and line: a joint that SMPL has not, a name or
// a joint that is there twice.
std::optional<JointNameMap> parse_joint_name_map(std::string_view text, const std::string& file);

// The SMPL joint of each name that the map has, "" of the others. Throws
// InputError where the map names a joint that is not among them; `file`: of the
// names.
std::vector<std::string> mapped(const JointNameMap& map, const std::vector<std::string>& names,
                                const std::string& file);

}  // namespace duet
