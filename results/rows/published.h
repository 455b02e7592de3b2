// A run that others rely on: its rows without the traces that only plots of single episodes need, and a manifest with
// the SHA-256 of every file. A run directory like any other to read; what is in it can neither change unnoticed nor
// grow.
#pragma once

#include <map>
#include <set>
#include <string>

#include "duet/results/rows/manifest.h"

namespace duet {

// Files of a run, named from its folder, that are not published, and texts that stand in the place of others.
struct Withheld {
  std::set<std::string> files;
  std::map<std::string, std::string> replaced;
};

// Writes `folder` at once: it is there whole or not at all. Files that the run names by their places on its machine are
// named from the working folder. Throws InputError for what is no run or a run without rows,
// and where `folder` is there already.
void publish_run(const std::string& run, const std::string& folder, const Withheld& withheld = {});

}  // namespace duet
