// A callback that is told of each file that a thread reads whole (core/file.h), so that a reader knows nothing of those
// who want to know what it read. One per thread; only core/digest.h uses it.
#pragma once

#include <string>
#include <string_view>

namespace duet {

using ReadObserver = void (*)(const std::string& path, std::string_view bytes);

// This thread's; null: nobody is told.
ReadObserver& read_observer();

}  // namespace duet
