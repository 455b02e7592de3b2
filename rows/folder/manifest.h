// The manifest of a published run: the SHA-256 of every file.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace duet {

// Lists every file that is in `folder` by now, beside what `about` says of the run. Throws StorageError.
void write_manifest(const std::string& folder, nlohmann::json about);

bool is_published(const std::string& folder);

// Throws InputError (file, expected, found) where `folder` is published and a file is not what the manifest says.
void check_published(const std::string& folder);

}  // namespace duet
