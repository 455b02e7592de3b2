// `duet hw play-partner`: a clip in the place of a camera.
#pragma once

#include "duet/app/command.h"

namespace duet::cli {

void add_play_partner(CLI::App& hardware, Session& session);

}  // namespace duet::cli
