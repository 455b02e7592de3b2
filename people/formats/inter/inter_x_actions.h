// The 40 actions of Inter-X (its action_setting.txt), which the names of its clips number: G001T000A018R005.
#pragma once

#include <optional>
#include <string>

namespace duet {

// "Whisper in ear" of a clip whose name says A018; nothing where the name is of another kind or number.
std::optional<std::string> inter_x_action(const std::string& clip);

}  // namespace duet
