// Clips that a run has synthesised and retargeted, kept in its folder until it is complete: a run that is killed while
// it prepares goes on where it stopped. A file's name is the digest of all that made it; one that is broken, or of
// another program, robot or option, is made anew. Thread-safe.
#pragma once

#include <optional>
#include <string>

#include "duet/motion/paired_motion.h"

namespace duet {

class PreparedClips {
 public:
  // Keeps clips in `folder`/prepared; an empty folder keeps nothing. `made_by` is what all its clips have in common.
  PreparedClips(std::string folder, const std::string& made_by) : folder_(std::move(folder)), made_by_(made_by) {}

  [[nodiscard]] bool keeps() const { return !folder_.empty(); }
  // `source` is what tells this clip from others. None where there is no whole file of it.
  [[nodiscard]] std::optional<PairedMotion> find(const std::string& source) const;
  // Keeps the clip where the disk takes it.
  void keep(const std::string& source, const PairedMotion& clip) const;

 private:
  [[nodiscard]] std::string name_of(const std::string& source) const;

  std::string folder_, made_by_;
};

// Removes them, and nothing else, from a run folder.
void remove_prepared_clips(const std::string& folder);

// This program: version, and size and time of its file (core/share.h), so that a program that was built anew trusts
// nothing older.
std::string program_identity();

}  // namespace duet
