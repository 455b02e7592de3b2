#include "bench/clips.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "bench/parallel.h"
#include "bench/progress.h"
#include "core/npz.h"
#include "core/require.h"
#include "motion/synthesis.h"
#include "retarget/pair.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

struct ClipSource {
  Task task = Task::kHug;
  int index = 0;
  std::string file;
  const ClipVariant* variant = nullptr;  // of the suite; null: as drawn
};

bool runs(const Suite& suite, Task task) {
  return std::find(suite.tasks.begin(), suite.tasks.end(), task) != suite.tasks.end();
}

std::vector<ClipSource> list_sources(const Suite& suite) {
  std::vector<ClipSource> sources;
  for (const std::string& file : suite.clips.files) sources.push_back({Task::kHug, 0, file});
  for (const Task task : suite.tasks) {
    for (int index = 0; index < suite.clips.synth_per_task; ++index) {
      if (suite.clips.variants.empty()) sources.push_back({task, index, ""});
      for (const ClipVariant& variant : suite.clips.variants) sources.push_back({task, index, "", &variant});
    }
  }
  return sources;
}

PairedMotion make_clip(const ClipSource& source, const Suite& suite, const RobotModel& robot,
                       const PairOptions& options) {
  if (!source.file.empty()) return load_or_retarget(source.file, robot, options);
  SynthesisOptions synthesis;
  synthesis.seed = suite.clips.synth_seed;
  synthesis.index = source.index;
  if (source.variant == nullptr) return retarget(synthesize(source.task, synthesis), robot, options);
  synthesis.side = source.variant->side;
  synthesis.target_height = source.variant->target_height;
  InteractionClip clip = synthesize(source.task, synthesis);
  clip.id += "-" + source.variant->name;
  return retarget(clip, robot, options);
}

void check_ids(const std::vector<PairedMotion>& clips) {
  for (size_t i = 0; i < clips.size(); ++i) {
    for (size_t j = i + 1; j < clips.size(); ++j) {
      if (clips[i].clip_id == clips[j].clip_id && clips[i].task == clips[j].task)
        throw InputError(fmt::format("two clips of task {} have the id '{}'; ids name episodes and must differ",
                                     to_string(clips[i].task), clips[i].clip_id));
    }
  }
}

}  // namespace

MotionFile kind_of(const std::string& path) {
  const Npz npz = Npz::load(path);
  const std::string schema = npz.text("schema");
  if (schema == "duet.interaction_clip") return MotionFile::kClip;
  if (schema == "duet.paired_motion") return MotionFile::kPaired;
  if (schema == "duet.recording") return MotionFile::kRecording;
  throw InputError(fmt::format(
      "{}: key 'schema': expected 'duet.interaction_clip', 'duet.paired_motion' or 'duet.recording', found '{}'", path,
      schema));
}

PairedMotion load_or_retarget(const std::string& path, const RobotModel& robot, const PairOptions& options) {
  switch (kind_of(path)) {
    case MotionFile::kClip:
      return retarget(load_clip(path), robot, options);
    case MotionFile::kPaired:
      return load_paired_motion(path);
    default:
      throw InputError(fmt::format("{}: expected a clip or a paired motion, found a recording", path));
  }
}

PairOptions pair_options(const Suite& suite) {
  PairOptions options;
  for (const auto& [name, value] : suite.retarget) set_pair_option(options, name, value);
  return options;
}

std::vector<PairedMotion> prepare_clips(const Suite& suite, const RobotModel& robot, int threads, Progress& progress) {
  const std::vector<ClipSource> sources = list_sources(suite);
  const PairOptions options = pair_options(suite);
  std::vector<std::optional<PairedMotion>> made(sources.size());
  progress.start("preparing clips", static_cast<int>(sources.size()), "clips");
  parallel_for_each(static_cast<int>(sources.size()), threads, [&](int i) {
    made[i] = make_clip(sources[i], suite, robot, options);
    progress.advance();
  });
  progress.finish();
  std::vector<PairedMotion> clips;
  for (const Task task : suite.tasks) {
    for (std::optional<PairedMotion>& clip : made)
      if (clip && clip->task == task && runs(suite, task)) clips.push_back(std::move(*clip)), clip.reset();
  }
  if (clips.empty()) throw InputError(fmt::format("{}: no clip is left for the tasks of the suite", suite.file));
  for (const PairedMotion& clip : clips) {
    if (clip.robot.joint_names != robot.joint_names())
      throw InputError(fmt::format("clip '{}' was retargeted to another robot: its joints are not those of '{}'",
                                   clip.clip_id, robot.name));
  }
  check_ids(clips);
  return clips;
}

std::vector<PairedMotion> synthetic_clips(const RobotModel& robot, const std::vector<Task>& tasks, int per_task,
                                          std::uint64_t seed, int threads, Progress& progress) {
  Suite suite;
  suite.file = "synthetic clips";
  suite.tasks = tasks;
  suite.clips.synth_per_task = per_task;
  suite.clips.synth_seed = seed;
  return prepare_clips(suite, robot, threads, progress);
}

std::vector<std::string> find_motion_files(const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    if (!fs::exists(path)) throw InputError(fmt::format("cannot read '{}': No such file or directory", path));
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    std::vector<std::string> found;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path))
      if (entry.is_regular_file() && entry.path().extension() == ".npz") found.push_back(entry.path().string());
    if (found.empty()) throw InputError(fmt::format("'{}' holds no .npz file", path));
    std::sort(found.begin(), found.end());
    files.insert(files.end(), found.begin(), found.end());
  }
  return files;
}

}  // namespace duet
