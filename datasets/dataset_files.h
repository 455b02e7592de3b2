// Names of a data set's files below its folder, and the files that are derived from its entries: they can be made again
// at any time.
#pragma once

#include <string>
#include <vector>

#include "duet/datasets/entry.h"

namespace duet {

std::string people_file(const std::string& clip);                           // "people/CLIP.npz"
std::string robot_file(const std::string& robot, const std::string& clip);  // "g1/CLIP.npz"
std::string rejected_file(const std::string& clip);                         // "rejected/CLIP.svg"

// manifest.json (the entries in the order of their ids), annotations.csv, tables/*.csv, card.md, card.html. The same
// entries give the same bytes. Throws StorageError.
void write_derived_files(const std::string& folder, const std::vector<DatasetEntry>& entries);

}  // namespace duet
