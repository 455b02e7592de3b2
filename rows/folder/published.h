// A run that others rely on: its rows without the traces that only plots of single episodes need, and a manifest with
// the SHA-256 of every file. A run directory like any other to read; what is in it can neither change unnoticed nor
// grow.
#pragma once

#include <map>
#include <set>
#include <string>

#include "duet/rows/folder/manifest.h"

namespace duet {

// Additions to the published rows, suite and environment: files of the run, named from its folder, and texts that stand
// under such a name.
struct PublishedInputs {
  std::set<std::string> files = {};
  std::map<std::string, std::string> texts = {};
};

// Writes `folder` at once: it is there whole or not at all. Files that the run names by their places on its machine are
// named from the working folder. Nothing else of the run is copied. Throws InputError for what is no run or a run
// without rows, for a file that is a link, and where `folder` is there already.
void publish_run(const std::string& run, const std::string& folder, const PublishedInputs& inputs = {});

}  // namespace duet
