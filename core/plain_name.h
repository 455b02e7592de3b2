// Names that stand in tables, keys and file names: letters, digits and _ . + - only, and none of + and - first: options
// of a command line and formulas of a spreadsheet begin so.
#pragma once

#include <string>
#include <string_view>

namespace duet {

bool is_plain_letter(char letter);
bool is_plain_name(std::string_view name);
std::string plain_name_message(std::string_view name);  // the sentence for one that is not

}  // namespace duet
