// Files that ship with duet: robot cards, engine profiles, limit tables.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace duet {

// The file `relative` ("profiles/parity.yaml") in $DUET_SHARE, else in ../share/duet beside the program, else in the
// source tree of the machine that built it. Throws MissingError naming `what` ("robot card") and the places looked at.
std::string share_file(std::string_view what, std::string_view relative);

// The first of `places` that exists; throws MissingError naming them all where none does.
std::string first_existing(std::string_view what, const std::vector<std::string>& places);

}  // namespace duet
