// The clips of a suite, retargeted and ready to roll out: synthesised or read, one PairedMotion each.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/core/digest.h"
#include "duet/experiment/suite/suite.h"
#include "duet/motion/paired_motion.h"
#include "duet/motion/plausibility.h"
#include "duet/retarget/options.h"
#include "duet/robots/robot_model.h"

namespace duet {

class Progress;
class StopToken;

struct PrepareOptions {
  std::string keep_in = {};         // a run folder that keeps the clips as each is finished (experiment/plan/clips.h)
  const StopToken* stop = nullptr;  // asked before each clip
  // Digests that the files' must be (RunIdentity::files), for those that it has; InputError for another one.
  const FileDigests* files = nullptr;
};

// The kind of motion that an NPZ holds, by its key `schema`. Throws InputError for anything else.
enum class MotionFile { kClip, kPaired, kRecording };
MotionFile kind_of(const Npz& npz);

struct LoadedMotion {
  PairedMotion motion;
  std::vector<std::string> notes;  // what a clip's reader should know (motion/plausibility.h)
};

// A clip, padded and retargeted, or a paired motion; `other_role`: with the robot in the place of the other person.
// Throws InputError; for a recording with what is needed instead, and for a paired motion that is to be padded or to
// change roles.
LoadedMotion load_or_retarget(const Npz& npz, const RobotModel& robot, const PairOptions& options,
                              Implausible implausible = Implausible::kRefused, const ClipPadding& pad = {},
                              bool other_role = false);

// Clips whose task the suite runs, in a fixed order (task, then index or file). Retargets on `threads` threads; what
// there is to know of them is noted on `progress`. Throws InputError where none remains, Stopped
// (experiment/work/stop_token.h) where it was asked to stop.
std::vector<PairedMotion> prepare_clips(const Suite& suite, const RobotModel& robot, int threads, Progress& progress,
                                        const PrepareOptions& options = {});

// The clips that a suite synthesises itself, in their own role, by id with the tags of their rows. Beside files it has
// at most so many.
std::map<std::string, Tags> synthetic_clips(const std::vector<Task>& tasks, const SuiteClips& clips);

// Clips that are no suite's: `per_task` of each task, for training. People stand 2.5 to 5.5 s before the act, half of
// them frozen in its first frame as padded recordings are.
std::vector<PairedMotion> synthetic_clips(const RobotModel& robot, const PairOptions& pair,
                                          const std::vector<Task>& tasks, int per_task, std::uint64_t seed, int threads,
                                          Progress& progress, Likeness like = Likeness::kScripted);

PairOptions pair_options(const Suite& suite);

// Clips that are given take the place of the suite's; a task without clips is left out. None: the suite's own stay.
// Throws std::invalid_argument for a suite of walking commands, and as find_clip_files.
void use_clips(const std::vector<std::string>& paths, Suite& suite);

// The files that find_motion_files gives, but of a folder that is a data set (docs/datasets.md) its people alone.
std::vector<std::string> find_clip_files(const std::vector<std::string>& paths);
// Whether a folder is a data set that `duet dataset` made.
bool is_dataset(const std::string& folder);

// NPZ files below the paths given (files stay, folders are searched), sorted. Throws InputError for a path that is not
// there or where nothing is found.
std::vector<std::string> find_motion_files(const std::vector<std::string>& paths);

// Clips that a run has synthesised and retargeted, kept in its folder until it is complete: a run that is killed while
// it prepares goes on where it stopped. A file's name is the digest of all that made it; one that is broken, or of
// another program, robot or option, is made anew. Thread-safe.

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
