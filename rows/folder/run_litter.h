// Files that a killed process left half-written beside those that they were to become: "run.json.part-4711-0".
#pragma once

#include <string>

namespace duet {

// Removes those of processes that are no more from a run folder, its trajectories and its prepared clips. Only while
// nobody else works in the folder: a process of another machine cannot be seen from here.
void remove_litter(const std::string& folder);

}  // namespace duet
