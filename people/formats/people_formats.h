// The table of formats that two-person motion comes in.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/people/people_format.h"

namespace duet {

std::span<const PeopleFormat> people_formats();
std::vector<std::string> people_format_names();

// The first format that recognises the paths, or the one of that name. Throws InputError where none does, and lists
// what was looked for; std::invalid_argument for an unknown name.
const PeopleFormat& find_people_format(std::span<const std::string> paths, std::string_view name = {});

// The clip at a place; its source says the format, and its licence where that is known.
SourceClip read_source_clip(const PeopleFormat& format, const ClipPlace& place, const PeopleOptions& options = {});

}  // namespace duet
