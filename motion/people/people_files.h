// Helpers that the readers of this folder share: folders, labels, and arrays of positions. Thread-safe.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/npy/npy.h"
#include "duet/archives/pickle/pickle_node.h"
#include "duet/core/recording.h"
#include "duet/core/task.h"

namespace duet {

// The task that a label of others names ("Shake hands", "01_hugging", "High-five"); nothing where it is none of ours.
std::optional<Task> task_of_label(std::string_view label);

// Names in a folder, sorted; hidden ones and links out of it are left out. Empty where it is no folder.
std::vector<std::string> names_in(const std::string& folder);

// The folders at or below `paths` for which `is_clip` holds, sorted; nothing below one of them, and at most `depth`
// levels down. Links are not followed.
std::vector<std::string> folders_below(std::span<const std::string> paths, int depth,
                                       bool (*is_clip)(const std::string& folder));
// Whether there is one; looks at no more folders than it needs.
bool any_folder_below(std::span<const std::string> paths, int depth, bool (*is_clip)(const std::string& folder));

bool is_file(const std::string& path);
std::string stem_of(const std::string& path);
std::string file_name_of(const std::string& path);
// "/data/train/01_hugging/001" of 2 parts: "01_hugging-001".
std::string id_of(const std::string& path, int parts);

// Files of a folder named by the number of a frame ("00001.npy"), in order. Throws InputError naming the folder:
// another name with that ending, or a number left out between the first and the last.
std::vector<std::string> numbered_files(const std::string& folder, std::string_view ending);

// One NPY file. Throws InputError naming it.
NpyArray read_npy(const std::string& path);
// Numbers as they are, also those that are not finite. Throws InputError for text; `what` ("'a.npz': array 'x'") begins
// the message.
std::vector<double> numbers_of(NpyArray array, const std::string& what);
// (T, K, 3) of an array (T, columns) or (T, K, 3 or more): the first `points` points from number `first` on. Throws
// InputError naming the shape.
PointTracks tracks_of(NpyArray array, int points, const std::string& what);

// The value of a key. Throws InputError naming the key and those that are there.
const PickleNode& get(const Pickle& pickle, const PickleNode& dict, std::string_view key);

// Sentences of a file that is no data set: "'x': expected ..., found nothing of it".
[[noreturn]] void refuse_paths(std::span<const std::string> paths, const std::string& expected);

}  // namespace duet
