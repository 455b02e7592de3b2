// Text within HTML.
#pragma once

#include <string>
#include <string_view>

namespace duet {

std::string escape_html(std::string_view text);  // also for attribute values in double quotes

}  // namespace duet
