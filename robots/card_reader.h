// Reads a card and what it extends. Format: docs/file-formats.md, "Robot card".
#pragma once

#include <string>

#include "duet/robots/card.h"

namespace duet {

// Cards that one may extend in a row.
inline constexpr int kMostExtended = 8;

// `file` names the card and is where `extends` starts from; what it extends is read and is a card of its own, whose
// keys stand where the card has none. Throws InputError as YamlSection does, and for a cycle, naming both files.
RobotCard parse_card(const std::string& text, const std::string& file);

}  // namespace duet
