// The pages of docs/reference, made from the tables that read what they describe: `duet list WHAT --markdown` prints
// one, `./run reference` writes all, and a test holds the files against them.
#pragma once

#include <string>
#include <vector>

namespace duet {

// The listings that have a page, by the names that `duet list` takes.
std::vector<std::string> reference_page_names();
// Throws std::invalid_argument for another name, with those that are known.
std::string reference_page(const std::string& name);

}  // namespace duet
