// Inter-X as SMPL-X parameters: motions/<clip>/P1.npz and P2.npz, one world, y up, 120 Hz. The clip's name says the
// action (A018), annots/interaction_order.pkl who begins.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "duet/people/people_format.h"

namespace duet {

const PeopleFormat& inter_x_format();

// Notes what the data set's own lists say of a clip: its action (of its name) and who reacts
// (annots/interaction_order.pkl in one of the three folders above `file`). Throws InputError naming that file.
void note_inter_x_clip(const std::string& clip, const std::string& file, RawPeople& raw);

inline constexpr std::string_view kInterXLicence = "Inter-X: non-commercial research";

// The 40 actions of Inter-X (its action_setting.txt), which the names of its clips number: G001T000A018R005.

// "Whisper in ear" of a clip whose name says A018; nothing where the name is of another kind or number.
std::optional<std::string> inter_x_action(const std::string& clip);

}  // namespace duet
