// The clips of a suite, retargeted and ready to roll out: synthesised or read, one PairedMotion each.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bench/suite.h"
#include "motion/paired_motion.h"
#include "retarget/options.h"
#include "robots/robot_model.h"

namespace duet {

class Progress;

// Reads a clip (and retargets it) or a paired motion: the file's `schema` key tells which. Throws InputError.
PairedMotion load_or_retarget(const std::string& path, const RobotModel& robot, const PairOptions& options);

// Whether an NPZ holds a clip, a paired motion or a recording. Throws InputError for anything else.
enum class MotionFile { kClip, kPaired, kRecording };
MotionFile kind_of(const std::string& path);

// Clips whose task the suite runs, in a fixed order (task, then index or file). Retargets on `threads` threads.
// Throws InputError where none remains.
std::vector<PairedMotion> prepare_clips(const Suite& suite, const RobotModel& robot, int threads, Progress& progress);

// The same of clips that are no suite's: `per_task` of each task, for training.
std::vector<PairedMotion> synthetic_clips(const RobotModel& robot, const std::vector<Task>& tasks, int per_task,
                                          std::uint64_t seed, int threads, Progress& progress);

PairOptions pair_options(const Suite& suite);

// NPZ files below the paths given (files stay, folders are searched), sorted. Throws InputError for a path that is not
// there or where nothing is found.
std::vector<std::string> find_motion_files(const std::vector<std::string>& paths);

}  // namespace duet
