// English words that say little: the built-in language encoder leaves them out of phrases. The tasks' definitions say
// which words mean tasks (tasks/task_definition.h).
#pragma once

#include <span>
#include <string_view>

namespace duet {

std::span<const std::string_view> function_words();

}  // namespace duet
