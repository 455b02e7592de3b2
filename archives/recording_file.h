// Recordings as NPZ (docs/file-formats.md, "Recording").
#pragma once

#include <string>

#include "duet/core/recording.h"

namespace duet {

class Npz;

// Writes or reads a recording as NPZ (keys in docs/file-formats.md). The write is atomic. Throws InputError.
void save_recording(const Recording& recording, const std::string& path);
Recording load_recording(const std::string& path);
// The same as an archive, for files that hold more than the recording; other keys are not looked at.
Npz recording_npz(const Recording& recording);
Recording read_recording(const Npz& npz);

}  // namespace duet
