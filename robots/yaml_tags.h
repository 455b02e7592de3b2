// The mapping `tags` of an item of a suite (core/episode_tags.h).
#pragma once

#include <string>
#include <string_view>

#include "duet/core/episode_tags.h"
#include "duet/robots/yaml_section.h"

namespace duet {

inline constexpr const char* kTagsKey = "tags";

// None where the key is absent. `of`: what the item is, kOfPerturbation for one. Throws InputError: a name that is no
// plain one or that duet gives itself, a value that is no plain name, a level, stage or seed that is no whole number.
Tags read_tags(const YamlSection& item, std::string_view of);

// ", tags: {level: 3}", to stand in a mapping behind another key; "" for none.
std::string tags_yaml(const Tags& tags);

}  // namespace duet
