// Who is told of each file that a thread reads whole (core/file.h): a reader knows nothing of who wants to know what it
// read. One a thread; core/digest.h is the one that there is.
#pragma once

#include <string>
#include <string_view>

namespace duet {

using ReadObserver = void (*)(const std::string& path, std::string_view bytes);

// This thread's; null: nobody is told.
ReadObserver& read_observer();

}  // namespace duet
